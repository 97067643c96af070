"""ASAM's checker, where it is installed: what it finds wrong is wrong here too."""

import shutil

import pytest

from benchmarks.openscenario_qc import CHECKER, findings, main
from scenarios.openscenario import check


def test_without_the_checker_one_line_says_so(tmp_path, capsys):
    assert main([str(tmp_path), "--checker", "no_such_checker"]) == 0
    assert capsys.readouterr().out.startswith("skipped: no no_such_checker; pip install")


def test_a_file_of_ours_has_no_errors(write, tmp_path):
    if shutil.which(CHECKER) is None:
        pytest.skip("asam-qc-openscenarioxml is not installed")
    path = write()
    assert findings(CHECKER, path, tmp_path) == []
    assert check(path).verdict == "supported"


def test_a_duplicated_name_is_an_error_for_both(write, tmp_path):
    if shutil.which(CHECKER) is None:
        pytest.skip("asam-qc-openscenarioxml is not installed")
    path = write()
    path.write_text(path.read_text().replace('ScenarioObject name="Other"', 'ScenarioObject name="Ego"'))
    rules = findings(CHECKER, path, tmp_path)
    assert rules is not None
    assert "unique_element_names_on_same_level" in " ".join(rules)
    assert check(path).verdict == "refused"
