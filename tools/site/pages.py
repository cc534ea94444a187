"""Pages of the documentation: their links, their commands, and the copies that the site is built of.

    pages.py stage FOLDER   checks the links, copies the pages with what they link to, and makes links to folders ones to pages
    pages.py check FOLDER   checks the links of the built site, and that it needs nothing from a network
"""

import os
import re
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(\]\()([^)#\s]*)(#[^)\s]*)?(?=\))")
FENCE = re.compile(r"^```.*?^```$", re.M | re.S)


def pages(root=ROOT):
    """Every page that a reader may be led to."""
    found = [page for page in root.rglob("*.md") if not page.relative_to(root).parts[0].startswith(("build", "results", "."))]
    return sorted(found)


def slug(text, separator="-"):
    """The name by which a heading is linked: small letters, digits, and hyphens for spaces."""
    return re.sub(r"[^\w\- ]", "", text.lower()).strip().replace(" ", separator)


def anchors_of(page):
    return {slug(head) for head in re.findall(r"^#+ (.*)", FENCE.sub("", page.read_text()), re.M)}


def links_of(page):
    """Relative targets and anchors of a page's links and pictures; what stands in code is none."""
    text = re.sub(r"`[^`\n]+`", "", FENCE.sub("", page.read_text()))
    return [(target, (anchor or "")[1:]) for _, target, anchor in LINK.findall(text) if not re.match(r"\w+:", target)]


def broken_links(root=ROOT):
    problems = []
    for page in pages(root):
        for target, anchor in links_of(page):
            aim = page.parent / target if target else page
            name = f"{page.relative_to(root)}: {target}{'#' if anchor else ''}{anchor}"
            if not aim.exists():
                problems.append(f"{name}: there is no such file")
            elif anchor and (not aim.is_file() or anchor not in anchors_of(aim)):
                problems.append(f"{name}: there is no such heading")
    return problems


def commands_of(page):
    """Lines of the blocks that are indented by four spaces: what a reader types, without comments; continued lines are joined."""
    text = FENCE.sub("", page.read_text()).replace("\\\n", " ")
    lines = re.findall(r"^    (\S.*)$", text, re.M)
    return [line for line in (re.sub(r"\s+#.*", "", line).strip() for line in lines) if not line.startswith("#")]


def stage(target):
    """Copies pages, pictures and files that pages name, in their places; a link to a folder leads to its page."""
    def leads(page):
        def to_page(match):
            head, aim, anchor = match[1], match[2], match[3] or ""
            if aim and "://" not in aim and (page.parent / aim).is_dir():
                inside = page.parent / aim / "README.md"
                if not inside.exists():
                    raise SystemExit(f"site: {page.relative_to(ROOT)}: {aim} is a folder without a page")
                aim = os.path.join(aim, "README.md")
            return head + aim + anchor
        return to_page

    for page in pages():
        for aim, _ in links_of(page):
            file = (page.parent / aim).resolve()
            if file.is_file() and file.suffix != ".md":
                copy = target / file.relative_to(ROOT)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, copy)
        text = LINK.sub(leads(page), page.read_text())
        # a list may follow its paragraph without a blank line on GitHub
        text = re.sub(r"^((?![-#|>`\s]).+)\n(?=- )", r"\1\n\n", text, flags=re.M)
        copy = target / page.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(text)


class Built(HTMLParser):
    """What a built page offers and asks for."""

    def __init__(self, file):
        super().__init__()
        self.names, self.links, self.loaded = set(), [], []
        self.feed(file.read_text())

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.names |= {given[key] for key in ("id", "name") if given.get(key)}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        source = given.get("src") or (given.get("href") if tag == "link" and given.get("rel") != "canonical" else None)
        if source:
            self.loaded.append(source)


def problems_of_site(folder):
    built = {file: Built(file) for file in sorted(folder.rglob("*.html")) if file.name != "404.html"}
    problems = []
    for file, page in built.items():
        name = file.relative_to(folder)
        problems += [f"{name} loads {source}" for source in page.loaded if re.match(r"(\w+:)?//", source)]
        for link in page.links + page.loaded:
            aim, _, anchor = unquote(link).partition("#")
            aim = aim.partition("?")[0]
            if re.match(r"\w+:|//|/", aim):
                continue
            other = (file.parent / aim).resolve() if aim else file
            if not other.exists():
                problems.append(f"{name} leads to {link}: there is no such file")
            elif anchor and other in built and anchor not in built[other].names:
                problems.append(f"{name} leads to {link}: there is no such heading")
    return problems


def main(word, folder):
    problems = broken_links() if word == "stage" else problems_of_site(Path(folder).resolve())
    if problems:
        raise SystemExit("\n".join(f"site: {problem}" for problem in problems))
    if word == "stage":
        stage(Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
