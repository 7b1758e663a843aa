"""The wheel carries everything it needs: installed in a fresh environment outside the checkout, the command runs there."""

import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]


def run(*command, cwd):
    done = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


def test_installed_wheel_plans_outside_the_checkout(tmp_path):
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path, cwd=ROOT)
    (wheel,) = tmp_path.glob("*.whl")
    # the new environment sees this one's dependencies, so the test needs no network, but not this checkout
    environment = tmp_path / "env"
    venv.create(environment, with_pip=False)
    (packages,) = environment.glob("lib/python*/site-packages")
    dependencies = next(Path(path) for path in sys.path if path.endswith("site-packages"))
    (packages / "dependencies.pth").write_text(f"{dependencies}\n", encoding="utf-8")
    run(
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-index",
        "--target",
        packages,
        wheel,
        cwd=tmp_path,
    )
    python = environment / "bin" / "python"
    # -P keeps the working folder off the path; the target folder stands before the dependencies' own editable hook
    where = run(python, "-P", "-c", "import planner; print(planner.__file__)", cwd=tmp_path)
    assert Path(where.strip()).is_relative_to(packages)
    command = packages / "bin" / "lidarplan"
    assert command.exists()
    run(python, "-P", "-m", "planner.cli", "new", tmp_path / "campaign", cwd=tmp_path)
    out = run(python, "-P", "-m", "planner.cli", "point", tmp_path / "campaign" / "site.yaml", cwd=tmp_path)
    assert "azimuth" in out.lower()
    run(
        python,
        "-P",
        "-m",
        "planner.cli",
        "report",
        tmp_path / "campaign" / "site.yaml",
        "--out",
        tmp_path / "out",
        cwd=tmp_path,
    )
    assert (tmp_path / "out" / "report.html").stat().st_size > 100_000
