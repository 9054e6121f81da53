"""`retraverse weights`: which pretrained weights there are, fetch, convert and verify them."""

from pathlib import Path
from typing import Annotated, Any

import typer

from retraverse.cli.options import JsonOutput
from retraverse.cli.output import print_json, print_table, progress, remark
from retraverse.errors import InputError
from retraverse.weights import (
    WeightEntry,
    find_weights,
    get_weights,
    import_weights,
    names_in_store,
    stored_weights,
    verify_weights,
    weight_entry,
    weights_folder,
)
from retraverse.weights.catalogue import catalogue

__all__ = ["app"]

app = typer.Typer(help="Pretrained weights: list, get, import, verify.", no_args_is_help=True)

AcceptChanged = Annotated[
    bool,
    typer.Option(
        "--accept-changed", help="Take the file although its checksum is not the one expected."
    ),
]


@app.command("list")
def list_weights(
    technique: Annotated[
        str | None, typer.Option("--technique", "-t", help="Only those of one technique.")
    ] = None,
    json_output: JsonOutput = False,
) -> None:
    """List published weights, and which of them are here."""
    rows = [_entry_row(entry) for entry in catalogue()]
    published = {row["name"] for row in rows}
    rows += [_own_row(name) for name in names_in_store() if name not in published]
    if technique is not None:
        rows = [row for row in rows if row["technique"] == technique]
    if json_output:
        print_json({"folder": str(weights_folder()), "weights": rows})
        return
    remark(f"weights are kept in {weights_folder()}")
    head = ("name", "here", "size", "checksum", "licence")
    print_table([_cells(row) for row in rows], head=head)


@app.command("get")
def get(
    name: Annotated[str, typer.Argument(help="A name of `retraverse weights list`.")],
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="URL|FILE", help="Another address, or a file of yours."),
    ] = None,
    accept_changed: AcceptChanged = False,
    json_output: JsonOutput = False,
) -> None:
    """Fetch weights, check them, convert them once. Carries on where it was stopped."""
    entry = weight_entry(name)
    if not json_output:
        remark(f"{name}: licence {entry.licence}; please cite {entry.citation}")
    path = get_weights(name, source=source, accept_changed=accept_changed, progress=progress())
    _report(name, path, json_output)


@app.command("import")
def import_file(
    file: Annotated[
        Path, typer.Argument(help="caffemodel, .mat, .pb, .h5, .pth, .tflite, .onnx, .npz, …")
    ],
    name: Annotated[
        str | None, typer.Option("--name", help="What to call it; default: from the file's name.")
    ] = None,
    accept_changed: AcceptChanged = False,
    json_output: JsonOutput = False,
) -> None:
    """Convert a weights file of any known format into the store, once."""
    path = import_weights(file, name=name, accept_changed=accept_changed)
    _report(path.name.removesuffix(".safetensors"), path, json_output)


@app.command("verify")
def verify(
    names: Annotated[
        list[str] | None, typer.Argument(help="Which; default: all that are here.")
    ] = None,
    json_output: JsonOutput = False,
) -> None:
    """Compute the checksums of what is here again; exit code 2 if anything changed."""
    verdicts = verify_weights(names, progress=progress())
    if json_output:
        print_json([{"name": v.name, "state": v.state, "detail": v.detail} for v in verdicts])
    else:
        print_table([(v.name, v.state, v.detail) for v in verdicts], head=("name", "state", ""))
    bad = [verdict.name for verdict in verdicts if verdict.state != "ok"]
    if bad:
        raise InputError(
            f"weights {', '.join(bad)}: not as recorded, expected the same bytes; "
            "get or import them again"
        )


def _report(name: str, path: Path, json_output: bool) -> None:
    record = stored_weights(name)
    if json_output:
        sha256 = record.published.sha256 if record else None
        print_json({"name": name, "path": str(path), "published_sha256": sha256})
    else:
        print(path)


def _entry_row(entry: WeightEntry) -> dict[str, Any]:
    record = stored_weights(entry.name)
    return {
        "name": entry.name,
        "technique": entry.technique,
        "here": _is_here(entry.name),
        "n_bytes": entry.n_bytes or (record.published.n_bytes if record else None),
        "checksum": _checksum_word(entry),
        "licence": entry.licence,
        "citation": entry.citation,
        "format": entry.format,
        "file_name": entry.file_name,
        "addresses": list(entry.addresses),
        "note": entry.note,
    }


def _own_row(name: str) -> dict[str, Any]:
    record = stored_weights(name)
    return {
        "name": name,
        "technique": "",
        "here": _is_here(name),
        "n_bytes": record.published.n_bytes if record else None,
        "checksum": "pinned" if record else "none",
        "licence": "yours to know",
        "citation": "",
        "format": record.format if record else "",
        "file_name": "",
        "addresses": [record.source] if record else [],
        "note": "imported",
    }


def _is_here(name: str) -> bool:
    try:
        find_weights(name)
    except InputError:
        return False
    return True


def _checksum_word(entry: WeightEntry) -> str:
    if entry.seal.has_checksum:
        return "published"
    return "pinned" if stored_weights(entry.name) else "none yet"


def _cells(row: dict[str, Any]) -> list[str]:
    size = f"{row['n_bytes'] / 1e6:.1f} MB" if row["n_bytes"] else "?"
    here = "yes" if row["here"] else ""
    return [row["name"], here, size, row["checksum"], row["licence"]]
