import subprocess
import sys
from pathlib import Path

import residyn
from conftest import command


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


def test_everything_public_is_documented() -> None:
    for name in residyn.__all__:
        public = getattr(residyn, name)
        assert isinstance(public, str) or public.__doc__, name
        for member, value in vars(public).items() if isinstance(public, type) else ():
            assert member.startswith("_") or value.__doc__, f"{name}.{member}"
