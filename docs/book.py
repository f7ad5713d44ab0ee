"""What `mdbook build` asks to make pages of documents that lie outside docs/, and links of those that lead there.

A page whose text is only `{{#include ../NAME.md}}` shows that document. Its links, and links to it from other pages, are written
for the repository; here they become links between pages of the book. A link to anything that is no page becomes the file's name.
"""

import json
import os
import re
import sys

INCLUDE = re.compile(r"\{\{#include (\S+)\}\}\s*")
LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")
CODE = re.compile(r"(^```.*?^```)", re.MULTILINE | re.DOTALL)


def chapters(items):
    """All chapters, those within others too."""
    for item in items:
        chapter = item.get("Chapter") if isinstance(item, dict) else None
        if chapter:
            yield chapter
            yield from chapters(chapter["sub_items"])


def main():
    context, book = json.load(sys.stdin)
    source = os.path.join(context["root"], context["config"]["book"].get("src", "src"))
    pages = list(chapters(book.get("items", book.get("sections", []))))
    # Which document each page shows, by its path from the root.
    origin = {}
    for page in pages:
        shown = INCLUDE.fullmatch(page["content"])
        document = os.path.normpath(os.path.join(source, shown.group(1) if shown else page["path"]))
        origin[page["path"]] = os.path.relpath(document, context["root"])
        if shown:
            with open(document, encoding="utf-8") as file:
                page["content"] = file.read()
    place = {document: page for page, document in origin.items()}
    own = os.path.relpath(source, context["root"])
    for page in pages:
        folder = os.path.dirname(origin[page["path"]])

        def link(found):
            mark, text, to = found.groups()
            path, hash_, anchor = to.partition("#")
            if not path or re.match(r"[a-z]+:", path):
                return found.group()
            target = os.path.normpath(os.path.join(folder, path))
            if target in place:
                return f"{mark}[{text}]({place[target]}{hash_}{anchor})"
            if target.startswith(own + os.sep):
                return f"{mark}[{text}]({os.path.relpath(target, own)}{hash_}{anchor})"
            return f"`{target}`" if text.strip("`") in target else f"{text} (`{target}`)"

        parts = CODE.split(page["content"])
        parts[::2] = [LINK.sub(link, part) for part in parts[::2]]
        page["content"] = "".join(parts)
    json.dump(book, sys.stdout)


if __name__ == "__main__" and sys.argv[1:2] != ["supports"]:
    main()
