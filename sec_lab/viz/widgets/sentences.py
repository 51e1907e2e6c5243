"""Errors as one sentence, for those who sit before a widget."""

import html


def sentence_of(error: BaseException) -> str:
    r"""What went wrong, in one line; the kind of error only where the message is no sentence of ours.

    Examples
    --------
    >>> sentence_of(ValueError("movie: expected two frames,\n got one"))
    'movie: expected two frames, got one.'
    """
    words = " ".join(str(error).split())
    if not isinstance(error, ValueError) or not words:
        words = f"{type(error).__name__}: {words}" if words else type(error).__name__
    return words if words.endswith((".", "!", "?")) else f"{words}."


def as_alert(sentence: str) -> str:
    """A sentence as HTML that screen readers read out, or nothing.

    Examples
    --------
    >>> as_alert("a < b.")
    '<span role="alert" class="sec-lab-alert" style="color: ...">a &lt; b.</span>'
    """
    if not sentence:
        return ""
    style = "color: var(--jp-error-color1, #c4371d); font-weight: 600"
    return f'<span role="alert" class="sec-lab-alert" style="{style}">{html.escape(sentence)}</span>'
