"""Execution (step 8): from a model and a scene to motion, and back to what was seen (§2.10)."""
