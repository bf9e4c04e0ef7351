"""Parse an exported LaTeX document strictly, look for what must be in it, and typeset it where pdflatex is installed."""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

from pylatexenc.latexwalker import LatexEnvironmentNode, LatexWalker

path, expected = pathlib.Path(sys.argv[1]), json.loads(pathlib.Path(sys.argv[2]).read_text())
text = path.read_text()
nodes, _, _ = LatexWalker(text, tolerant_parsing=False).get_latex_nodes()


def environments(nodes):
    for node in nodes or []:
        if isinstance(node, LatexEnvironmentNode):
            yield node.environmentname
        yield from environments(getattr(node, "nodelist", None))


found = list(environments(nodes))
assert found[0] == "document", found
for name in expected["environments"]:
    assert name in found, f"no {name} in {found}"
for piece in expected["pieces"]:
    assert piece in text, f"no {piece!r} in\n{text}"

if shutil.which("pdflatex"):
    with tempfile.TemporaryDirectory() as folder:
        command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "-output-directory", folder, path]
        run = subprocess.run(command, capture_output=True, text=True)
        assert run.returncode == 0, run.stdout
