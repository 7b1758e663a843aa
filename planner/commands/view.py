"""`lidarplan view SITE`: the 3-D scene as a picture, a page, a model or a window."""

from typing import Annotated

import typer

from planner.commands.options import (
    DEFAULT_OUT,
    FidelityOption,
    JsonOption,
    OutOption,
    QuietOption,
    SiteArgument,
    remark,
    say,
    say_json,
)

KINDS = ("html", "png", "glb")

KindOption = Annotated[
    str | None,
    typer.Option(
        "--as", metavar="html,png,glb", help="What to write. [default: html, and png where OpenGL is]"
    ),
]
StretchOption = Annotated[
    float, typer.Option("--exaggeration", metavar="FACTOR", help="Stretch heights; 1 is true proportions.")
]
WindowOption = Annotated[bool, typer.Option("--window", help="Open a window instead of writing files.")]


def register(app: typer.Typer) -> None:
    """Add the command to the application."""
    app.command("view")(view)


def view(
    site: SiteArgument,
    kind: KindOption = None,
    exaggeration: StretchOption = 1.0,
    window: WindowOption = False,
    out: OutOption = DEFAULT_OUT,
    fidelity: FidelityOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """3-D scene: self-contained HTML, PNG, glTF, or a window."""
    from planner.commands.choices import chosen, within
    from planner.commands.load import load_plan
    from planner.output import output_folder, require_folder
    from planner.plan_scene import plan_scene
    from planner.scene.export import left_out_png, write

    kinds = None if kind is None else [chosen("--as", word.strip(), KINDS) for word in kind.split(",")]
    within("--exaggeration", exaggeration, 0.0, open_below=True)
    if not window:
        require_folder(out)
    scene = plan_scene(load_plan(site, fidelity)).exaggerated(exaggeration)
    if window:
        from planner.scene.pyvista_adapter import show

        show(scene)
        return
    reason = left_out_png() if kinds is None else None
    wanted = kinds or (["html"] if reason else ["html", "png"])
    with output_folder(out) as folder:
        names = [write(scene, folder, word).name for word in wanted]
    paths = [str(out / name) for name in names]
    if json:
        say_json({"files": paths})
    else:
        say("\n".join(paths))
    if reason:
        remark(f"No picture: {reason}", quiet=quiet)
