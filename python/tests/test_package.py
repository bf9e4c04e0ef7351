import ast
import inspect
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import residyn
from conftest import command
from residyn import _residyn

sys.path.append(str(Path(__file__).parents[2] / "scripts"))
import stubs  # noqa: E402


def test_the_command_is_in_the_package() -> None:
    assert command("--version").stdout == f"residyn {residyn.__version__}\n"
    missing = command("audit", "/no/such/log.csv")
    assert missing.returncode == 2 and "cannot be read" in missing.stderr


def test_the_stubs_are_those_of_the_module() -> None:
    checked = [
        [sys.executable, "-m", "mypy", "--strict", "-p", "residyn"],
        [Path(sys.executable).parent / "stubtest", "residyn"],
    ]
    for check in checked:
        found = subprocess.run(check, capture_output=True, text=True, check=False, cwd=Path(sys.prefix))
        assert found.returncode == 0, found.stdout


def test_the_stub_has_the_docstrings_of_the_module() -> None:
    written = stubs.STUB.read_text()
    assert stubs.with_docstrings(written, _residyn) == written, "run scripts/stubs.py"


def test_the_stub_has_every_name_of_the_module() -> None:
    tree = ast.parse(stubs.STUB.read_text())
    stubbed = {node.name: node for node in tree.body if isinstance(node, stubs.Documented)}
    assert set(stubbed) == {name for name in dir(_residyn) if not name.startswith("_")}
    for name, node in stubbed.items():
        owner = getattr(_residyn, name)
        members = {member for member in vars(owner) if member[0] != "_"} if isinstance(owner, type) else set()
        assert {part.name for part in node.body if isinstance(part, ast.FunctionDef) and part.name[0] != "_"} == members
        for part in [node, *node.body]:
            if isinstance(part, ast.FunctionDef) and part.name[0] != "_":
                of = owner if part is node else getattr(owner, part.name)
                if callable(of):
                    wanted = [*inspect.signature(of).parameters]
                    given = part.args.posonlyargs + part.args.args + part.args.kwonlyargs
                    assert [argument.arg for argument in given] == wanted, part.name


def calls() -> list[object]:
    """Everything public that takes arguments."""
    public = [getattr(residyn, name) for name in residyn.__all__]
    classes = [value for value in public if isinstance(value, type)]
    methods = [getattr(of, name) for of in classes for name in vars(of) if not name.startswith("_")]
    # Nobody makes these.
    made = {residyn.Episode, residyn.Model, residyn.Parameter, residyn.Report, residyn.ResidynError}
    routines = [value for value in [*public, *methods] if inspect.isroutine(value) and callable(value)]
    return [*routines, *(of for of in classes if of not in made)]


@pytest.mark.parametrize("call", calls())
def test_every_argument_is_in_a_docstring(call: Callable[..., object]) -> None:
    documented = inspect.getdoc(call) or ""
    for argument in inspect.signature(call).parameters:
        assert argument == "self" or f"\n    {argument}: " in documented, argument


def test_everything_public_is_documented() -> None:
    for name in residyn.__all__:
        public = getattr(residyn, name)
        assert isinstance(public, str) or public.__doc__, name
        for member, value in vars(public).items() if isinstance(public, type) else ():
            assert member.startswith("_") or value.__doc__, f"{name}.{member}"
