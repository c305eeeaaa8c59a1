"""What the forms of the repository say agrees with the rest."""

import re

import viewcell
from builders.places import ROOT


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_citation_is_of_this_version():
    assert f"\nversion: {viewcell.__version__}\n" in text("CITATION.cff")


def test_commits_are_linted_by_the_version_that_is_locked():
    locked = re.search(r"^ruff==([\d.]+)", text("requirements.lock"), re.MULTILINE)[1]
    assert f"ruff-pre-commit\n    rev: v{locked}\n" in text(".pre-commit-config.yaml")


def test_github_runs_what_runs_here():
    assert "- run: .ci/run\n" in text(".github/workflows/ci.yml")
    for command in ("make lint", "make docs", "make test", "make test-slow"):
        assert f"\n{command}\n" in text(".ci/run") and f"\n{command[5:]}: install\n" in text("Makefile")


def test_a_wrong_verdict_comes_with_its_case_file():
    form = text(".github/ISSUE_TEMPLATE/wrong-verdict.yml")
    case = form[form.index("id: case") : form.index("id: commands")]
    assert "Attach the case file" in case and "required: true" in case
