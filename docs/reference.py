"""Makes reference.md, every key of a pipeline, from the JSON Schema: ao4d schema | python3 docs/reference.py > docs/reference.md"""

import json
import sys

HEAD = """# Every key of a pipeline

Made from `ao4d schema` by `docs/reference.py`; editors show the same while one types. A pipeline is a mapping with these keys.

"""


def page(schema):
    """The page, as Markdown."""
    defs = schema["$defs"]
    parts = [HEAD + table(schema, defs)]
    shown, open_ = set(), []

    def section(title, name):
        if name in shown:
            return
        shown.add(name)
        definition = defs[name]
        rows = table(definition, defs)
        about = flat(definition.get("description", ""))
        parts.append(f"## {title}\n\n<a id=\"{name.lower()}\"></a>{about}\n\n{rows}")
        open_.extend(sections(definition, defs))

    kinds = [next(iter(one["properties"].items())) for one in defs["StageSpec"]["oneOf"]]
    links = ", ".join(f"[`{kind}`](#{target(inner).lower()})" for kind, inner in kinds)
    parts.append(f'<a id="stagespec"></a>A stage is a mapping with one key, its kind: {links}.\n')
    for kind, inner in kinds:
        section(f"`{kind}`", target(inner))
    open_.extend(name for name in sections(schema["properties"], defs) if name != "StageSpec")
    while open_:
        name = open_.pop(0)
        section(title_of(name, schema), name)
    return "\n".join(parts)


def title_of(name, schema):
    """What is written before a mapping of this kind: the keys that take it."""
    keys = []
    for definition in [*schema["$defs"].values(), schema]:
        for key, value in keys_of(definition).items():
            if name in sections(value, schema["$defs"]) and key not in keys:
                keys.append(key)
    return ", ".join(f"`{key}`" for key in keys) or name


def is_shown(defs, name):
    """Whether a definition has keys, and so a section of its own."""
    return bool(defs[name].get("properties")) or any("properties" in one for one in defs[name].get("oneOf", []))


def sections(value, defs, within=()):
    """The definitions with sections of their own that a value refers to, also by those that have none."""
    found = []
    for name in referred(value):
        if is_shown(defs, name):
            found.append(name)
        elif name not in within:
            found += sections(defs[name], defs, (*within, name))
    return found


def target(value):
    """The name of the definition that a value refers to."""
    return value["$ref"].rsplit("/", 1)[-1]


def referred(value):
    """All names of definitions within a value, in their order."""
    if isinstance(value, dict):
        own = [target(value)] if "$ref" in value else []
        return own + [name for key, inner in value.items() if key != "$ref" for name in referred(inner)]
    if isinstance(value, list):
        return [name for inner in value for name in referred(inner)]
    return []


def keys_of(definition):
    """All keys of a mapping, those among them of which one is chosen."""
    rows = dict(definition.get("properties", {}))
    for one in definition.get("oneOf", []):
        rows.update(one.get("properties", {}))
    return rows


def table(definition, defs):
    rows = keys_of(definition)
    if not rows:
        return ""
    needed = definition.get("required", [])
    lines = ["| key | value | meaning |", "| --- | --- | --- |"]
    for key, value in rows.items():
        about = flat(value.get("description", "")) or flat(defs[target(value)].get("description", "") if "$ref" in value else "")
        mark = " (needed)" if key in needed and "oneOf" not in definition else ""
        lines.append(f"| `{key}`{mark} | {kind(value, defs)} | {about} |".replace("|  |", "| |"))
    return "\n".join(lines) + "\n"


def kind(value, defs):
    """What a value is, in a few words."""
    if "$ref" in value:
        name = target(value)
        return f"[mapping](#{name.lower()})" if is_shown(defs, name) else kind(defs[name], defs)
    for choice in ("anyOf", "oneOf"):
        if choice in value:
            words = [kind(one, defs) for one in value[choice] if one.get("type") != "null"]
            return " or ".join(dict.fromkeys(words))
    if "const" in value:
        return f"`{value['const']}`"
    if "enum" in value:
        return " or ".join(f"`{word}`" for word in value["enum"] if word is not None)
    types = value.get("type", "anything")
    types = [t for t in (types if isinstance(types, list) else [types]) if t != "null"]
    words = {"integer": "whole number", "number": "number", "string": "text", "boolean": "`true` or `false`", "object": "mapping"}
    texts = []
    for name in types:
        if name == "array":
            items = value.get("items")
            texts.append("list" + (f" of {kind(items, defs)}" if isinstance(items, dict) and items else ""))
        else:
            texts.append(words.get(name, name) + bounds(value))
    return " or ".join(texts)


def bounds(value):
    low, high = value.get("minimum"), value.get("maximum")
    low = None if low == 0 and value.get("format", "").startswith("uint") and high is None else low
    if low is None and high is None:
        return ""
    show = lambda n: f"{n:g}" if isinstance(n, float) else str(n)
    if high is None:
        return f", {show(low)} or more"
    return f", {show(low)} to {show(high)}" if low is not None else f", up to {show(high)}"


def flat(text):
    """In one line, fit for a table."""
    return " ".join(text.split()).replace("|", "\\|")


if __name__ == "__main__":
    sys.stdout.write(page(json.load(sys.stdin)))
