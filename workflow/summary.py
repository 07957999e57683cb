#!/usr/bin/env python3
"""One table of all runs, the worst first: summary.csv, and summary.html with links to their pages;
throughput.csv, how long the steps took.

Worse is, in this order: failed, unfinished, more lost frames, more doubtful frames, a larger expected
deviation. The summary holds no times, so that it is the same however often the workflow was interrupted.
"""

import argparse
import csv
import html
import io
import json
import sys
from pathlib import Path

import runs

STEPS = ["check", "reconstruct", "evaluate", "appearance", "report"]
# Of a verdict: the quantity, which of its numbers, factor.
QUANTITIES = {
    "silhouette": ("silhouette", "worst", 1),
    "uncovered_percent": ("uncovered", "worst", 100),
    "correlation": ("correlation", "worst", 1),
    "psnr_db": ("psnr", "mean", 1),
    "deviation_percent": ("deviation", "worst", 100),
}
# Errors against the truth, where there is one: key, factor to millimetres.
ERRORS = {"chamfer_mm": ("cd1", 1e3), "depth_mm": ("depth", 1e3), "vertex_mm": ("vertex", 1e3)}
COLUMNS = [
    "state",
    "frames",
    "found",
    "doubtful",
    "lost",
    "lost_frames",
    "doubtful_frames",
    *QUANTITIES,
    *ERRORS,
    "message",
    "page",
]
FOLDER = Path(__file__).resolve().parent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--table", type=Path)
    parser.add_argument(
        "--so-far", action="store_true", help="some runs came to no end: write summary-so-far.* instead"
    )
    parser.add_argument("--verdict", action="store_true", help="say what summary.csv holds; status 1 if a run failed")
    arguments = parser.parse_args()
    if arguments.verdict:
        return verdict(arguments.out)
    table = runs.read(arguments.table)
    if arguments.so_far and all(note_path(arguments.out, "report", run).exists() for run in table.values()):
        return  # all came to an end, some of them failed: the summary is complete
    rows = sorted(
        (row(run, arguments.out, arguments.so_far) for run in table.values()), key=lambda row: row.pop("badness")
    )
    # Those of the table first; columns that nobody has are left out.
    swept = [column for run in table.values() for column, _ in run.cells]
    columns = dict.fromkeys(["run", "scene", *swept, *COLUMNS])
    columns = [c for c in columns if any(row.get(c, "") != "" for row in rows)]
    stem = "summary-so-far" if arguments.so_far else "summary"
    replace(arguments.out / f"{stem}.csv", as_csv(rows, columns))
    replace(arguments.out / f"{stem}.html", page(rows, [c for c in columns if c != "page"]))
    if not arguments.so_far:
        for suffix in ["csv", "html"]:
            (arguments.out / f"summary-so-far.{suffix}").unlink(missing_ok=True)
        replace(arguments.out / "throughput.csv", throughput(table, arguments.out))


def row(run, out, so_far):
    """A row of the summary; `badness` sorts it."""
    notes = [read(note_path(out, step, run)) for step in STEPS]
    failed = next((note for note in notes if note and note["status"]), None)
    result = out / "results" / run.name
    row = {"run": run.name, "scene": run.scene.name} | dict(run.cells) | {"state": "unfinished"}
    if not notes[-1] and not so_far:
        sys.exit(f"{note_path(out, 'report', run)} is missing; run the workflow again")
    found = notes[1] and not notes[1]["status"]
    if found and not (result / "summary.json").exists():
        sys.exit(f"{result} is gone; bring it back, or remove {note_path(out, 'reconstruct', run)} to compute it again")
    verdict = (read(result / "summary.json") or {}).get("verdict") if found else None
    parts = [0, 0, 0]
    if verdict:
        counts = verdict["counts"]
        row |= {"state": verdict["state"], "frames": sum(counts.values())} | counts
        row["lost_frames"] = " ".join(f"{first}-{end - 1}" for first, end in verdict["lost"])
        row["doubtful_frames"] = " ".join(f"{first}-{end - 1}" for first, end in verdict["doubtful"])
        for name, (key, which, factor) in QUANTITIES.items():
            row[name] = number(factor * verdict[key][which]) if verdict.get(key) else ""
        deviation = (verdict.get("deviation") or {}).get("worst", 0)
        parts = [-counts["lost"] / row["frames"], -counts["doubtful"] / row["frames"], -deviation]
    errors = (notes[2] or {}).get("errors") or {}
    row |= {
        name: number(factor * errors[key]) if errors.get(key) is not None else ""
        for name, (key, factor) in ERRORS.items()
    }
    if failed:
        row["state"] = "failed"
        row["message"] = f"{failed['step']}, status {failed['status']}: {' '.join(failed['message'].split())}"
    elif verdict:
        row["message"] = verdict["sentence"] if notes[-1] else f"unfinished; {verdict['sentence']}"
    if found:
        row["page"] = f"results/{run.name}/report.html"
    elif failed and failed["step"] == "check" and (out / "steps" / "check" / f"{run.scene.name}.png").exists():
        row["page"] = f"steps/check/{run.scene.name}.png"
    row["badness"] = ({"failed": 0, "unfinished": 1}.get(row["state"], 2), *parts, run.name)
    return row


def note_path(out, step, run):
    return out / "steps" / step / f"{run.scene.name if step == 'check' else run.name}.json"


def read(path):
    return json.loads(path.read_text()) if path.exists() else None


def number(value):
    return f"{value:.4g}"


def as_csv(rows, columns):
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def throughput(table, out):
    """Seconds, processor seconds and memory of every step, of its last try."""
    rows = []
    for run in table.values():
        for step in STEPS:
            note = read(note_path(out, step, run))
            if note and "seconds" in note and note["step"] == step:
                rows.append(
                    {"run": run.name, "step": step} | {key: note[key] for key in ["seconds", "cpu_seconds", "peak_mb"]}
                )
    return as_csv(rows, ["run", "step", "seconds", "cpu_seconds", "peak_mb"])


def count(rows):
    states = ["failed", "unfinished", "lost", "doubtful", "found"]
    counted = [(sum(row["state"] == state for row in rows), state) for state in states]
    return f"{len(rows)} runs: " + ", ".join(f"{n} {state}" for n, state in counted if n)


def page(rows, columns):
    """The table with links, without scripts but for sorting by a column."""
    head = "".join(f"<th>{html.escape(c.replace('_', ' '))}" for c in columns)
    body = "\n".join(f'<tr class="{row["state"]}">' + "".join(cell(row, c) for c in columns) for row in rows)
    title = html.escape(count(rows))
    return (
        (FOLDER / "summary_page.html")
        .read_text()
        .replace("{title}", title)
        .replace("{head}", head)
        .replace("{body}", body)
    )


def cell(row, column):
    text = html.escape(str(row.get(column, "")))
    if column == "run" and "page" in row:
        text = f'<a href="{html.escape(row["page"])}">{text}</a>'
    return f'<td class="message">{text}' if column == "message" else f"<td>{text}"


def replace(path, text):
    partial = path.with_name(f".{path.name}")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)


def verdict(out):
    with open(out / "summary.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    print(f"{count(rows)}; see {out / 'summary.html'}")
    failed = [row for row in rows if row["state"] == "failed"]
    for row in failed[:10]:
        print(f"  {row['run']}: {row['message']}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    try:
        main()
    except runs.TableError as error:
        sys.exit(str(error))
