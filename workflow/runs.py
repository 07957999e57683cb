"""The table of what to compute: which scenes, each with which settings.

A row is a scene. The column `scene` has its folder, relative to the table; every other column is an option of
`tessuto reconstruct` without its dashes (`preset`, `seed`, `frames`, …) or the key of a setting
(`tessuto settings`). A cell with several values, separated by `|`, is a sweep: one run of each; several such
cells, all combinations. An empty cell is the program's own default.

A run's name is made of all that distinguishes it from others, so that a new row, column or value never touches the runs
there are.
"""

import codecs
import csv
import hashlib
import io
import itertools
import re
from dataclasses import dataclass
from pathlib import Path

OPTIONS = {"preset", "seed", "frames"}
LONGEST = 150  # characters of a run's name: files beside its folder add to that, and 255 is the limit


class TableError(Exception):
    """Says what is wrong in the table, where, and what to do."""


@dataclass(frozen=True)
class Run:
    """One scene with one set of settings."""

    name: str
    scene: Path
    cells: tuple  # (column, value), without empty ones

    def options(self, appearance):
        """Arguments of `tessuto reconstruct`, or with `appearance` those of `tessuto appearance`."""
        arguments = []
        for column, value in self.cells:
            of_appearance = column.startswith("appearance.")
            if column in OPTIONS:
                if column == "seed" or not appearance:
                    arguments += [f"--{column}", value]
            elif of_appearance == appearance:
                arguments += ["--set", f"{column}={value}"]
        return arguments


def read(table):
    """The runs of a table, in its order. Raises TableError."""
    table = Path(table)
    lines = [line for line in io.StringIO(text(table), newline="") if line.strip() and not line.startswith("#")]
    # A line `sep=;`, semicolons and tabs are what spreadsheets write.
    told = re.fullmatch(r'"?sep=(.)"?\s*', lines[0]) if lines else None
    lines = lines[1:] if told else lines
    heading = re.sub(r'"[^"]*"', "", lines[0]) if lines else ""
    separator = told[1] if told else next((s for s in ";\t" if s in heading), ",")
    try:
        reader = csv.DictReader(lines, delimiter=separator, strict=True)
        rows = [row for row in reader if any(cell for cell in row.values())]
        columns = reader.fieldnames or []
    except csv.Error as error:
        raise TableError(
            f"{table}: is no CSV: {error}; end every quote, and write a quote within a cell twice"
        ) from None
    if "scene" not in columns:
        raise TableError(f"{table}: there is no column `scene` among {columns}; the first line names the columns")
    wrong = [
        c
        for c in columns
        if c != "scene" and c not in OPTIONS and not re.fullmatch(r"[a-z0-9_]+(\.[a-z0-9_]+)*", c or "")
    ]
    if wrong:
        raise TableError(f"{table}: columns {wrong} are no settings; `tessuto settings` lists those there are")
    runs, scenes = {}, {}
    for number, row in enumerate(rows, 1):
        place = f"{table}, row {number}"
        if None in row or None in row.values() or not row["scene"].strip():
            raise TableError(
                f"{place}: a cell is missing or there is one too many; every row has {len(columns)} cells, the "
                f"first a scene"
            )
        comma = next((c for c in columns if separator != "," and re.fullmatch(r"\s*-?\d+,\d+\s*", row[c] or "")), None)
        if comma:
            raise TableError(f"{place}: {comma} is {row[comma]!r}; numbers need a decimal point")
        scene = table.parent / row["scene"].strip()
        folder = scenes.setdefault(scene.name, scene)
        if folder != scene:
            raise TableError(f"{place}: {scene} and {folder} have the same name; give one folder another name")
        choices = [[(c, value) for value in split(row[c], place)] for c in columns if c != "scene" and row[c].strip()]
        for cells in itertools.product(*choices):
            run = Run(name(scene.name, cells, place), scene, cells)
            if run.name in runs:
                raise TableError(f"{place}: {run.name} is there twice; take one of them out")
            runs[run.name] = run
    if not runs:
        raise TableError(f"{table}: there is no row; write one scene folder to a line")
    return runs


def text(table):
    """The text of a table: UTF-8 with or without a byte order mark, UTF-16 with one. Raises TableError."""
    try:
        data = table.read_bytes()
    except OSError as error:
        raise TableError(f"{table}: {error.strerror}; name the table with --config scenes=FILE") from None
    encoding = "utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = 1 + data[: error.start].count(b"\n")
        raise TableError(
            f"{table}, line {line}: byte 0x{data[error.start]:02X} is no {encoding[:6].upper().rstrip('-')} "
            f'text; save the table as "CSV UTF-8"'
        ) from None


def split(cell, place):
    values = [value.strip() for value in cell.split("|")]
    if "" in values:
        raise TableError(f"{place}: {cell!r} has an empty value; values are separated by single |")
    return values


def name(scene, cells, place):
    """`curtain@bend=0.01,seed=3`: letters that need no quotes in a shell or an address."""
    text = scene + ("@" if cells else "") + ",".join(f"{column}={value}" for column, value in cells)
    if not re.fullmatch(r"[\w.][\w.+-]*(@[\w.+,=-]+)?", text, re.ASCII):
        raise TableError(
            f"{place}: {text!r} would be the run's name; use letters, digits and . _ + - in names and values"
        )
    if len(text) > LONGEST:
        digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        text = f"{text[: LONGEST - 13]},{digest}"
    return text
