import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from agents.arguments import launch, make_parser, option, parse


@dataclass
class Example:
    name: str = option("what it is called")
    n_envs: int = option("how many", 2)
    sound: tuple[float, ...] = option("any number of them", (0.5, 1.0))
    grid: tuple[int, int, int] = option("three of them", (1, 2, 3))
    settings: tuple[float, float] | None = option("two, or nothing", None)
    output: Path = option("a folder", Path("runs"))
    ship: bool = option("yes or no", False)


def read(*words):
    return parse(make_parser(Example, "An example."), Example, list(words))


@dataclass
class Nothing:
    """Arguments of a program that has none."""


def test_without_words_the_defaults_count():
    assert read("--name", "a") == Example("a")


def test_words_become_values_of_their_type():
    words = "--name a --n-envs 3 --sound 1 --grid 4 5 6 --settings 1 2 --output x --ship"
    wanted = Example("a", 3, (1.0,), (4, 5, 6), (1.0, 2.0), Path("x"), True)
    assert read(*words.split()) == wanted
    assert read("--name", "a", "--no-ship") == Example("a")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "required: --name"),
        ("--name a --n-envs many", "--n-envs: expected a number, got 'many'"),
        ("--name a --grid 1 2", "expected 3 arguments"),
        ("--name a --colour red", "--colour: no such argument"),
        ("--name a --out x", "--out: no such argument (did you mean --output?)"),
    ],
)
def test_wrong_words_are_named(words, message, capsys):
    with pytest.raises(SystemExit):
        read(*words.split())
    assert message in capsys.readouterr().err


def test_the_help_shows_every_option_with_its_default(capsys):
    with pytest.raises(SystemExit):
        read("--help")
    text = capsys.readouterr().out
    assert "--n-envs N" in text
    assert "how many (default: 2)" in text
    assert "what it is called\n" in text


@pytest.fixture
def ended(monkeypatch, capsys):
    """Calls a program that raises an error; returns its exit status and what it printed."""

    def call(error, kind=Nothing, *words):
        def main(arguments):
            raise error

        monkeypatch.setattr(sys, "argv", ["agents/ppo.py", *words])
        monkeypatch.setattr(sys, "orig_argv", ["python", "-m", "agents.ppo", *words])
        with pytest.raises(SystemExit) as stopped:
            launch(main, kind, None)
        return stopped.value.code, capsys.readouterr().err

    return call


def test_a_fault_is_one_line_and_exit_status_2(ended):
    told = ended(ValueError("scene: expected one of these"))
    assert told == (2, "python -m agents.ppo: scene: expected one of these\n")


def test_a_fault_names_the_option(ended):
    fault = ValueError("n_envs: expected a number at least 1, got 0")
    _, text = ended(fault, Example, "--name", "a")
    assert text == "python -m agents.ppo: --n-envs: expected a number at least 1, got 0\n"


def test_an_interruption_is_one_line(ended):
    assert ended(KeyboardInterrupt()) == (130, "python -m agents.ppo: interrupted\n")
