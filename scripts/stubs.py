"""The docstrings of the stub `residyn/_residyn.pyi`, for editors: they are copied from the Rust sources.

    python scripts/stubs.py    # with the package installed: brings the stub up to date

The rest of the stub is written by hand.
"""

import ast
import inspect
import sys
import textwrap
from pathlib import Path
from types import ModuleType

STUB = Path(__file__).parents[1] / "python" / "residyn" / "_residyn.pyi"

Documented = ast.ClassDef | ast.FunctionDef


def with_docstrings(stub: str, module: ModuleType) -> str:
    """The text of a stub with its docstrings replaced by those of the compiled module."""
    lines = stub.splitlines(keepends=True)
    # From the end, so that earlier lines keep their numbers.
    for node, owner in reversed(list(_public(ast.parse(stub), module))):
        text = inspect.cleandoc(getattr(owner, node.name).__doc__ or "")
        if not text:
            sys.exit(f"{owner.__name__}.{node.name} has no docstring")
        _put(lines, node, text)
    return "".join(lines)


def _public(tree: ast.Module | ast.ClassDef, owner: ModuleType | type) -> list[tuple[Documented, ModuleType | type]]:
    """The stub's declarations, in order, each with the object that it is an attribute of."""
    found: list[tuple[Documented, ModuleType | type]] = []
    for node in tree.body:
        if isinstance(node, Documented) and not node.name.startswith("_"):
            found.append((node, owner))
            if isinstance(node, ast.ClassDef):
                found.extend(_public(node, getattr(owner, node.name)))
    return found


def _put(lines: list[str], node: Documented, text: str) -> None:
    indent = " " * (node.col_offset + 4)
    docstring = textwrap.indent(f'"""{text}"""', indent, lambda line: line.strip() != "") + "\n"
    if "\n" in text:
        docstring = docstring.removesuffix('"""\n') + f'\n{indent}"""\n'
    first = node.body[0]
    if not _is_filler(first):
        begin = min([first.lineno, *(part.lineno for part in getattr(first, "decorator_list", []))]) - 1
        lines.insert(begin, docstring + "\n")
        return
    begin, end = first.lineno - 1, first.end_lineno or first.lineno
    head = lines[begin][: first.col_offset].rstrip()
    lines[begin:end] = [head + "\n" if head else "", docstring]


def _is_filler(first: ast.stmt) -> bool:
    """Whether a body begins with `...` or with a docstring."""
    return isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)


if __name__ == "__main__":
    from residyn import _residyn

    STUB.write_text(with_docstrings(STUB.read_text(), _residyn))
