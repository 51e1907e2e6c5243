"""What all tests share: examples that hypothesis draws are the same in every run of continuous integration."""

import os

from hypothesis import settings

# The first call of a compiled kernel may take seconds, so no example has a deadline.
settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")
