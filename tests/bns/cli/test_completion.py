"""Completion, as the shells themselves ask for it."""

import os
import shutil
import subprocess
import sys

import pytest

from bns.__main__ import main
from bns.cli.completion import SCRIPTS, candidates
from tests.sources import ROOT

ASKED = {
    "verb": (["comp"], {"compare", "completion"}),
    "preset": (
        ["run", "hexapod-"],
        {"hexapod-hybrid", "hexapod-nominal", "hexapod-recover", "hexapod-walk"},
    ),
    "verb of a verb": (["campaign", "pl"], {"plot"}),
    "verb of a verb of a verb": (["gap", "bench", ""], {"make", "run", "score"}),
    "option": (["run", "demo", "--world.r"], {"--world.reality", "--world.robot"}),
    "flag": (["run", "demo", "--no-re"], {"--no-resume", "--no-report"}),
    "choice": (["run", "demo", "--snn.kind", ""], {"three", "ensemble"}),
    "effect": (["run", "demo", "--damage", "wheel_g"], {"wheel_gain"}),
    "second effect": (["run", "demo", "--damage", "x@1", "wheel_g"], {"wheel_gain"}),
    "world": (["run", "demo", "--world", "static"], {"static-snn"}),
    "robot": (["models", "check", "khe"], {"khepera3"}),
    "stage": (["effects", "--stage", "t"], {"tracking"}),
    "after its place": (["models", "check", "khepera3", ""], set()),
    "a file": (["view", ""], set()),
    "no such verb": (["nothing", ""], set()),
}


@pytest.mark.parametrize("case", ASKED)
def test_what_could_come_next(case, capsys):
    words, wanted = ASKED[case]
    assert set(candidates(words)) == wanted
    assert not capsys.readouterr().err


def test_nothing_is_done_while_the_shell_asks(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in (["run", "demo", ""], ["campaign", "run", ""], ["doctor", ""]):
        candidates(words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("shell", SCRIPTS)
def test_a_script_for_each_shell(capsys, shell):
    assert main(["completion", shell]) == 0
    assert capsys.readouterr().out == SCRIPTS[shell]


CALLS = {
    "bash": """source {script}
COMP_WORDS=(bns run hexapod-) COMP_CWORD=2
_bns bns
printf '%s\\n' "${{COMPREPLY[@]}}"
""",
    "fish": "source {script}; complete -C 'bns run hexapod-'",
    "zsh": """zmodload zsh/zpty
zpty -b shell 'PS1= TERM=dumb zsh -f -i'
zpty -w shell 'autoload -Uz compinit && compinit -u -D; source {script}'
zpty -w shell $'bind''key "^I" list-choices; zstyle ":completion:*" list-colors'
sleep 1
zpty -w -n shell $'bns run hexapod-\\t'
sleep 3
zpty -r shell text '*hexapod-walk*' && print -r -- $text
""",
}


@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed")
def test_fish_offers_files_where_there_is_nothing_else(tmp_path):
    program = tmp_path / "bns"
    program.write_text('#!/bin/sh\ntest "$2" = gap && echo diagnose\ntrue\n')
    program.chmod(0o755)
    (tmp_path / "log.csv").touch()

    def offered(line: str) -> list[str]:
        words = f"{SCRIPTS['fish']}\ncomplete -C '{line}'"
        env = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
        done = subprocess.run(
            ["fish", "--no-config", "-c", words],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
            cwd=tmp_path,
            env={**env, "HOME": str(tmp_path)},
        )
        return [line.split("\t")[0] for line in done.stdout.splitlines()]

    assert offered("bns gap ") == ["diagnose"]
    assert "log.csv" in offered("bns view l")


@pytest.mark.parametrize("shell", CALLS)
def test_a_shell_completes(shell, tmp_path):
    if not shutil.which(shell):
        pytest.skip(f"{shell} is not installed")
    program = tmp_path / "bns"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m bns "$@"\n')
    program.chmod(0o755)
    script = tmp_path / "script"
    script.write_text(SCRIPTS[shell])
    done = subprocess.run(
        [shell, "-c", CALLS[shell].format(script=script)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        stdin=subprocess.DEVNULL,
        cwd=ROOT,
        env={
            **os.environ,
            "PATH": f"{tmp_path}:{os.environ['PATH']}",
            "HOME": str(tmp_path),
        },
    )
    assert "hexapod-walk" in done.stdout, done.stdout + done.stderr
    assert "hexapod-recover" in done.stdout
