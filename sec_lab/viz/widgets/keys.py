"""Keys of the page that belong to what has the focus, not to the notebook."""

ARROWS = """
function claimArrows(event) {
  const handle = event.target.closest?.(".sec-lab-controls .noUi-handle, .sec-lab-explorer .noUi-handle");
  if (!handle) return;
  const isPlain = !(event.ctrlKey || event.metaKey || event.altKey || event.shiftKey);
  handle.toggleAttribute("data-lm-suppress-shortcuts", isPlain);
}
if (!globalThis.secLabClaimsArrows) {
  globalThis.secLabClaimsArrows = true;
  window.addEventListener("keydown", claimArrows, true);
}
"""
"""Script: arrow keys move the slider that has the focus; Notebook 7 would go to another cell."""
