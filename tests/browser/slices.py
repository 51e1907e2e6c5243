"""The cells of a notebook that a widget needs, so that a page need not execute all of it."""

import ast
import builtins

from nbformat import NotebookNode

TAG = "nbval-ignore-output"
_COMPREHENSIONS = ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp


def widget_cells(notebook: NotebookNode) -> list[int]:
    """Indices of the code cells that show live widgets; views of servers are none."""
    return [
        place
        for place, cell in enumerate(notebook.cells)
        if cell.cell_type == "code" and TAG in cell.metadata.get("tags", [])
    ]


def needed_places(notebook: NotebookNode, places: list[int]) -> list[int]:
    """Indices of some cells and of those that bind what they use, directly or not, in their order."""
    chosen, wanted = set(places), set[str]()
    for place in range(max(places), -1, -1):
        cell = notebook.cells[place]
        if cell.cell_type == "code" and (place in chosen or _bound(cell.source) & wanted):
            chosen.add(place)
            wanted |= _used(cell.source)
    return sorted(chosen)


def needed_cells(notebook: NotebookNode, place: int) -> list[str]:
    """Sources of the cells that one cell needs, and of itself."""
    return [notebook.cells[needed].source for needed in needed_places(notebook, [place])]


def _names(source: str, context: type[ast.expr_context]) -> set[str]:
    return _names_in(ast.parse(source), context, frozenset())


def _names_in(node: ast.AST, context: type[ast.expr_context], own: frozenset[str]) -> set[str]:
    """Names in one part of a program; what a comprehension binds is its own."""
    if isinstance(node, _COMPREHENSIONS):
        targets = [one for part in node.generators for one in ast.walk(part.target)]
        own = own | {one.id for one in targets if isinstance(one, ast.Name)}
    is_one = isinstance(node, ast.Name) and isinstance(node.ctx, context) and node.id not in own
    found = {node.id} if is_one and isinstance(node, ast.Name) else set()
    return found.union(*(_names_in(child, context, own) for child in ast.iter_child_nodes(node)))


def _used(source: str) -> set[str]:
    return _names(source, ast.Load) - set(dir(builtins))


def _bound(source: str) -> set[str]:
    """Names that a cell binds, or whose content it changes by an index."""
    bound = _names(source, ast.Store)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            bound |= {(alias.asname or alias.name).split(".")[0] for alias in node.names}
        elif isinstance(node, ast.FunctionDef):
            bound.add(node.name)
        elif isinstance(node, ast.Subscript | ast.Attribute) and isinstance(node.ctx, ast.Store):
            inner = node.value
            while isinstance(inner, ast.Subscript | ast.Attribute):
                inner = inner.value
            if isinstance(inner, ast.Name):
                bound.add(inner.id)
    return bound
