"""Pages of the site that come from the Python package: its notebooks as they run, and a reference of all that is public.

It runs in an environment with the package and with nbclient (python/environment.sh)."""

import contextlib
import dataclasses
import inspect
import os
import pathlib
import re

import mimu
import nbformat
from nbclient import NotebookClient

ROOT = pathlib.Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "python" / "examples"
DATA = pathlib.Path(os.environ.get("MIMU_DATA", ROOT / ".." / "shared" / "data")).resolve()


def notebook(name):
    """A notebook as Markdown, with what its cells show."""
    book = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    text = "".join(cell.source for cell in book.cells)
    missing = "MIMU_DATA" in text and not (DATA / "imu_tk_xsens" / "xsens_acc.mat").is_file()
    if missing:
        print(f"{name}: shown without its results, as $MIMU_DATA lacks the recording (docs/recordings.md)")
    else:
        os.environ["MIMU_DATA"] = str(DATA)
        NotebookClient(book, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(EXAMPLES)}}).execute()
    parts = []
    for cell in book.cells:
        parts.append(cell.source if cell.cell_type == "markdown" else f"```python\n{cell.source}\n```")
        parts += [shown(output) for output in cell.get("outputs", [])]
    made = "without its results, as the public recording was missing" if missing else "as it ran"
    parts.append(f"*This page is the notebook `python/examples/{name}.ipynb`, {made}.*")
    return "\n\n".join(parts) + "\n"


def shown(output):
    """An output of a cell."""
    if output.output_type == "error":
        raise RuntimeError("\n".join(output.traceback))
    data = output.get("data", {})
    if "text/html" in data:
        # A blank line would end the HTML, and what is indented after it would be code.
        return "\n".join(line.strip() for line in data["text/html"].splitlines() if line.strip())
    return f"```text\n{(output.get('text') or data.get('text/plain', '')).rstrip()}\n```"


def reference():
    """All public names with their signatures and documentation."""
    out = ["# Reference of the Python package", "Results are SI unless the name says otherwise. [From Python](python.md) has an overview."]
    functions = [(name, thing) for name, thing in public() if not inspect.isclass(thing)]
    classes = [(name, thing) for name, thing in public() if inspect.isclass(thing)]
    out.append("## Functions")
    for name, thing in functions:
        out += [f"### mimu.{name}", f"```python\n{signature(name, thing)}\n```", prose(inspect.getdoc(thing))]
    out.append("## Results, files and errors")
    for name, thing in classes:
        out += [f"### mimu.{name}", prose(inspect.getdoc(thing)), *members(thing)]
    return "\n\n".join(part for part in out if part) + "\n"


def public():
    """Names and what they are, those of ``mimu.thermal`` last."""
    for name in mimu.__all__:
        if name != "thermal":
            yield name, getattr(mimu, name)
    for name, thing in vars(mimu.thermal).items():
        if getattr(thing, "__module__", "") == "mimu.thermal" and not name.startswith("_"):
            yield f"thermal.{name}", thing


class Bare:
    """A text that is shown without quotes."""

    def __init__(self, text):
        self.text = text

    def __repr__(self):
        return self.text


def signature(name, function):
    """With a line for each parameter."""
    given = inspect.signature(function)
    # Annotations are text in the source, which would be shown in quotes.
    bare = [p.replace(annotation=Bare(p.annotation)) if isinstance(p.annotation, str) else p for p in given.parameters.values()]
    result = given.return_annotation
    given = given.replace(parameters=bare, return_annotation=Bare(result) if isinstance(result, str) else result)
    short = name + str(given)
    if len(short) < 100:
        return short
    lines, star = [], False
    for parameter in given.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not star:
            lines.append("*")
            star = True
        star = star or parameter.kind is parameter.VAR_POSITIONAL
        lines.append(str(parameter))
    return f"{name}(\n" + "".join(f"    {line},\n" for line in lines) + f") -> {given.return_annotation!r}"


def members(cls):
    """Attributes of a result with the comments of its source, and the methods of a class."""
    lines, source = [], []
    # Its own, and those of the bases that results share.
    bases = [base for base in cls.__mro__ if base.__module__.split(".")[0] == "mimu"]
    for base in bases:
        # A class of the compiled part has no source.
        with contextlib.suppress(OSError, TypeError):
            source += inspect.getsource(base).splitlines()
    comment = []
    for line in source:
        if said := re.match(r"    #: (.*)", line):
            comment.append(said[1])
        elif field := re.match(r"    ([a-zA-Z]\w*): (.+?)(?: = .*)?$", line):
            lines.append(f"- `{field[1]}: {field[2]}`" + (f": {prose(' '.join(comment))}" if comment else ""))
            comment = []
        elif line.strip():
            comment = []
    inherited = {name: member for base in reversed(bases) for name, member in vars(base).items()}
    for name, member in sorted(inherited.items()):
        documented = inspect.getdoc(member)
        if name.startswith("_") or not documented or (dataclasses.is_dataclass(cls) and not callable(member)):
            continue
        call = "()" if callable(member) else ""
        lines.append(f"- `{name}{call}`: {prose(documented).splitlines()[0]}")
    return ["\n".join(lines)] if lines else []


def prose(text):
    """What reStructuredText marks, as Markdown does."""
    text = re.sub(r":\w+:`([^`]+)`", r"`\1`", text or "")
    return text.replace("``", "`").replace("<", "&lt;")
