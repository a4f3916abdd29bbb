"""Names of files that commands write."""

from __future__ import annotations

from pathlib import Path

import pytest

from hc_bringup.cli import main


@pytest.mark.parametrize("words", [["estimate", "press.csv"], ["simulate", "multisine"]])
def test_standard_output_is_no_file(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
) -> None:
    """Regression: `hc estimate press.csv -o -` wrote a file that is called -."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main([*words, "-o", "-"])
    assert end.value.code == 2
    assert "'-' is no file: name one" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
