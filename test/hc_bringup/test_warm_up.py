"""What ./hc compiles in two processes: every filter, in one of them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from hc_bringup import warm_up
from hc_estimator import available_filters, create_estimator


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the filters in the order in which they would be compiled."""
    names: list[str] = []

    def create(name: str) -> SimpleNamespace:
        return SimpleNamespace(warm_up=lambda: names.append(name))

    monkeypatch.setattr(warm_up, "create_estimator", create)
    monkeypatch.setattr(warm_up, "compile_parts_of_default", list)
    return names


@pytest.mark.parametrize("part", [None, "ahead", "rest"])
def test_one_alone_compiles_every_filter(part: str | None, compiled: list[str]) -> None:
    warm_up.main(part)
    assert sorted(compiled) == sorted(available_filters())
    longest_come_first = compiled[: len(warm_up.LONGEST)] == list(warm_up.LONGEST)
    assert longest_come_first == (part == "ahead")


def test_of_two_each_compiles_what_the_other_has_not_begun(
    tmp_path: Path, compiled: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    of_rest: list[str] = []

    def create(name: str) -> SimpleNamespace:
        def compile_it() -> None:
            compiled.append(name)
            if len(compiled) == 2:  # the other process begins while this one is at its second
                monkeypatch.setattr(warm_up, "create_estimator", create_of_rest)
                warm_up.main("rest", str(tmp_path))

        return SimpleNamespace(warm_up=compile_it)

    def create_of_rest(name: str) -> SimpleNamespace:
        return SimpleNamespace(warm_up=lambda: of_rest.append(name))

    monkeypatch.setattr(warm_up, "create_estimator", create)
    warm_up.main("ahead", str(tmp_path))
    assert compiled == list(warm_up.LONGEST[:2])
    assert sorted(compiled + of_rest) == sorted(available_filters())


@pytest.mark.timeout(900)  # who has changed a kernel compiles the filter here
def test_parts_of_the_default_filter_are_compiled_as_it_calls_them() -> None:
    """Else the work would be done twice, with other types."""
    create_estimator(warm_up.DEFAULT).warm_up()
    compiled_before = [sum(k.stats.cache_misses.values()) for k in warm_up.PARTS_OF_DEFAULT]
    warm_up.compile_parts_of_default()
    for kernel, before in zip(warm_up.PARTS_OF_DEFAULT, compiled_before, strict=True):
        assert sum(kernel.stats.cache_misses.values()) == before, kernel
        assert len(kernel._cache._cache_file._load_index()) == 1, kernel


def test_another_part_is_an_error() -> None:
    with pytest.raises(ValueError, match="part is one of ahead, rest"):
        warm_up.main("all")
