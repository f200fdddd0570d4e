"""`layoutexplore docs`: the documentation as a web site."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add `docs` to the command line."""

    @app.command(epilog="Example: layoutexplore docs --out site")
    def docs(
        out: Annotated[Path, typer.Option(help="Folder of the site.")] = Path("layoutexplore-out/docs"),
    ) -> None:
        r"""Build the documentation as a web site (needs pip install 'layoutexplore\[docs]')."""
        from layoutexplore.documentation.site import build_site
        from layoutexplore.files import check_places

        check_places(out)
        typer.echo("building the site (about a minute)", err=True)
        typer.echo(f"written: {build_site(out, typer.main.get_command(app))}")
        typer.echo(
            f"browsers search only what is served: python -m http.server --directory {quote(str(out))}"
        )
