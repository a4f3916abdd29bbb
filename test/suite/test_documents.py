"""Nothing cites what is not there: links, files and pages named in code and documents."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from hc_bringup.cli import COMMANDS
from hc_msgs_py import topics

ROOT = Path(__file__).resolve().parents[2]
OWN = ("src", "test", "config", "docs", ".ci")
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
NAMED_PAGE = re.compile(r"(?<![\w/.-])((?:\.\./)*[\w/-]+\.md)\b")
NAMED_MODULE = re.compile(r"`([\w/]+\.py)`")
ELSEWHERE = {
    "FILE.md",
    "page.md",
    "DIR/reproduction.md",
    "../../reproduction.md",  # of DIR, too
    "docs/spec.md",
    "data/README.md",
    "nowhere.md",
}
"""Pages that a user or a test makes, of others' projects, and of the recordings (not ours)."""


def own_files() -> Iterator[Path]:
    """Sources, tests, settings and pages; what is made or installed is not ours to check."""
    kinds = {".py", ".md", ".yaml", ".msg", ".cmake", ".txt", ".toml", ".js", ".html"}
    for top in OWN:
        for path in (ROOT / top).rglob("*"):
            if path.suffix in kinds and not {"node_modules", "__pycache__"} & set(path.parts):
                yield path
    yield from ROOT.glob("*.md")


def without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """What a link to a heading of the page may be called, by GitHub's rule."""
    heads = re.findall(r"^#+ (.*)$", without_code(page.read_text(encoding="utf-8")), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", head.lower()).strip() for head in heads)
    return {head.replace(" ", "-") for head in plain}


def is_ours(name: str, beside: Path) -> bool:
    """Whether the project has the page, by its path from the root, from docs or from the citer."""
    folders = (ROOT, ROOT / "docs", ROOT / "docs" / "reference", beside)
    paths = ((folder / name).resolve() for folder in folders)
    return any(path.is_file() and path.is_relative_to(ROOT) for path in paths)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_no_link_is_dead(page: Path) -> None:
    dead = []
    for target in LINK.findall(without_code(page.read_text(encoding="utf-8"))):
        if "://" in target or target.startswith("mailto:"):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists() or (anchor and anchor not in anchors(path)):
            dead.append(target)
    assert not dead


def test_no_page_is_cited_that_is_not_in_the_project() -> None:
    dead = {
        f"{path.relative_to(ROOT)} cites {name}"
        for path in own_files()
        for name in NAMED_PAGE.findall(path.read_text(encoding="utf-8", errors="replace"))
        if name not in ELSEWHERE and not is_ours(name, path.parent)
    }
    assert not dead


def test_no_issue_is_cited_that_a_reader_cannot_open() -> None:
    word = re.compile(r"\bissue (?:item|no\.?|#)? ?\d")
    cited = {
        str(path.relative_to(ROOT))
        for path in own_files()
        if path.suffix == ".py" and word.search(path.read_text(encoding="utf-8"))
    }
    assert not cited


def test_modules_that_pages_name_exist() -> None:
    known = [p.as_posix() for top in ("src", "test") for p in (ROOT / top).rglob("*.py")]
    dead = {
        f"{page.relative_to(ROOT)} names {name}"
        for page in PAGES
        if page.name != "CHANGELOG.md"  # it may tell of what has gone
        for name in NAMED_MODULE.findall(page.read_text(encoding="utf-8"))
        if not any(path.endswith(f"/{name}") for path in known)
    }
    assert not dead


def test_every_page_has_a_place_in_the_site() -> None:
    """`mkdocs build --strict` refuses a page that its navigation leaves out."""
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    names = [page.relative_to(ROOT / "docs").as_posix() for page in ROOT.glob("docs/**/*.md")]
    places = set(re.findall(r"^ +- (?:[^:\n]+: )?([\w/]+\.md)$", site, re.MULTILINE))
    assert set(names) == places


def build_the_site(config: Path, site: Path) -> subprocess.CompletedProcess[str]:
    """`mkdocs build --strict` into `site`; `--quiet` would count no warnings, and so never fail."""
    return subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", config, "--site-dir", site],
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=110,
    )


def test_the_site_is_built_strictly(tmp_path: Path) -> None:
    done = build_the_site(ROOT / "mkdocs.yml", tmp_path / "site")
    assert done.returncode == 0, done.stderr
    python = (tmp_path / "site" / "reference" / "python" / "index.html").read_text("utf-8")
    assert "create_estimator" in python


DEAD = ("nowhere.md", "#no-such-heading", "pictures/none.png", "../config")


def test_the_site_is_refused_with_a_dead_link(tmp_path: Path) -> None:
    """The configuration of the site itself, over one page: a warning for each dead link."""
    config = yaml.load((ROOT / "mkdocs.yml").read_text("utf-8"), Loader=yaml.BaseLoader)
    config["nav"] = ["index.md"]
    config.pop("not_in_nav")
    (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(config), encoding="utf-8")
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs" / "index.md"
    page.write_text("# Page\n\n[heading](#page)\n", encoding="utf-8")
    assert build_the_site(tmp_path / "mkdocs.yml", tmp_path / "site").returncode == 0
    links = "\n\n".join(f"{'!' if 'png' in link else ''}[words]({link})" for link in DEAD)
    page.write_text(f"# Page\n\n{links}\n", encoding="utf-8")
    done = build_the_site(tmp_path / "mkdocs.yml", tmp_path / "site")
    assert done.returncode != 0
    warnings = [line for line in done.stderr.splitlines() if line.startswith("WARNING")]
    assert len(warnings) == len(DEAD), done.stderr
    for link in DEAD:
        assert sum(f"'{link}'" in line for line in warnings) == 1, (link, warnings)


def test_settings_that_pages_name_exist() -> None:
    named = {
        name
        for page in PAGES
        for name in re.findall(r"`(config/[\w/.-]+)`", page.read_text(encoding="utf-8"))
    }
    assert "config/layouts/foxglove.json" in named
    assert not [name for name in sorted(named) if not (ROOT / name).exists()]


def test_the_design_names_every_topic_and_node() -> None:
    page = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    names = [v for k, v in vars(topics).items() if k.isupper() and not k.startswith("FRAME_")]
    assert len(names) >= 15
    assert not [name for name in names if name not in page]


def test_every_command_is_explained_somewhere() -> None:
    pages = [p for p in PAGES if "reference" not in p.parts]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    assert not [name for name in COMMANDS if f"hc {name}" not in text]
