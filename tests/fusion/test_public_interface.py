"""The public interface: names, random numbers, parameters, start-up, wrong words on the command line."""

import subprocess
import sys

import pytest

import fusion
from fusion import ParameterError, PluginError, build, generator
from fusion.cli.main import main
from tests.fusion.streams import world

SECOND = 1_000_000_000


NAMED = {"seed": 1, "time_ns": 5 * SECOND, "sensor": "uwb", "seq": 7, "purpose": 0}


@pytest.mark.parametrize(
    "other", [{}, {"seed": 2}, {"time_ns": 6 * SECOND}, {"sensor": "wifi"}, {"seq": 8}, {"purpose": 1}], ids=str
)
def test_random_numbers_of_an_epoch_are_named_by_it_and_the_seed_alone(other):
    one, again = generator(**NAMED), generator(**NAMED | other)
    assert (one.random(8).tolist() == again.random(8).tolist()) is (not other)


def test_unknown_estimator_and_parameter_are_answered_with_the_nearest():
    with pytest.raises(PluginError, match="did you mean 'ekf'"):
        build("efk", world())
    with pytest.raises(ParameterError, match="did you mean 'gate_probability'"):
        build("ekf", world(), {"gate_probabilty": 0.9})
    with pytest.raises(ParameterError, match="takes a float"):
        build("ekf", world(), {"gate_probability": "high"})


@pytest.mark.parametrize("code", ["import fusion", "import fusion.cli.main; fusion.cli.main.main(['--help'])"])
def test_start_up_imports_nothing_heavy(code):
    heavy = {"rerun", "scipy", "filterpy", "matplotlib", "mcap", "rich"}
    ask = f"{code}\nimport sys; print(); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", ask], check=True, capture_output=True, text=True).stdout
    assert not heavy & set(loaded.splitlines()[-1].split())


def test_command_line_answers_wrong_words(capsys):
    assert main(["bnch"]) == 2
    assert "did you mean 'bench'" in capsys.readouterr().err
    assert main(["info", "no-such-file.mcap"]) == 1
    assert "no-such-file.mcap" in capsys.readouterr().err


def test_public_names_exist():
    assert all(hasattr(fusion, name) for name in fusion.__all__)
