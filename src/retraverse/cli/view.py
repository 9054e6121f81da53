"""`retraverse view`: a study's report in the browser, following the study while it runs."""

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer

from retraverse.cli.output import progress, remark
from retraverse.errors import DataMissingError

__all__ = ["view"]


def view(
    study: Annotated[Path, typer.Argument(help="The study's folder.")],
    data: Annotated[
        Path | None,
        typer.Option(help="Data root, if the datasets are not where the plan found them."),
    ] = None,
    cache: Annotated[
        Path | None, typer.Option(help="Where the study keeps its matrices, if elsewhere.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 = any that is free.")] = 0,
    host: Annotated[
        str,
        typer.Option(help="Address to listen on; the default is reached from this machine alone."),
    ] = "127.0.0.1",
    published: Annotated[
        bool, typer.Option(help="Print the thesis' values beside ours where they apply.")
    ] = True,
) -> None:
    """Serve a study's report on this machine until Ctrl-C.

    The pages are those of `retraverse study report`, in a folder that is removed at the end. They
    say when a running study has new records, and show them at a reload.
    """
    from retraverse.reports import write_study_report
    from retraverse.reports.study_report.serve import StudyServer
    from retraverse.studies.keeping.light_records import study_folders

    study_folders(study)  # raises where there is none

    with tempfile.TemporaryDirectory(prefix="retraverse-view-") as name:
        folder = Path(name)
        show = progress()

        def write() -> object:
            return write_study_report(
                study,
                folder,
                published=published,
                pictures=pictures_of(study, data),
                cache=cache,
                progress=show,
            )

        server = StudyServer(study, folder, write, host=host, port=port)
        server.refresh()
        if host not in ("127.0.0.1", "localhost", "::1"):
            remark(f"warning: everybody who reaches {host} can read these pages")
        print(server.address, flush=True)
        try:
            server.serve()
        except KeyboardInterrupt:
            remark("stopped")


def pictures_of(study: Path, data: Path | None) -> Any:
    """Return what gives the report its pictures: a data root, or the folders the plan names.

    Raises
    ------
    DataMissingError
        If the data root is not there.
    """
    from retraverse.datasets.driven_again import find_driven
    from retraverse.studies.keeping.light_records import study_folders
    from retraverse.studies.keeping.study_folder import study_datasets

    if data is None:
        folders = study_folders(study)
        named = {name: one for path in folders for name, one in study_datasets(path).items()}
        return named.get
    if not data.is_dir():
        raise DataMissingError(f"{data}: no such folder, expected the data root")
    return lambda name: find_driven(name, data)
