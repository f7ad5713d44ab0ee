"""Checks the text of a ParaView state, without ParaView: check_state.py STATE

1. Its constants are plain Python values, printed as JSON for the caller to look at.
2. None of its global names, and none of the builtins that it uses, is a name of numpy's: ParaView runs the script of a
   programmable filter in the state's own namespace after `from numpy import *`, which would replace them.
3. It is ASCII, names no absolute path, and no line is longer than 120 characters but those with constants.
"""

import ast
import builtins
import json
import sys

import numpy
from vtkmodules.numpy_interface import algorithms

text = open(sys.argv[1], encoding="ascii").read()
tree = ast.parse(text)

constants, names = {}, set()
for statement in tree.body:
    if isinstance(statement, ast.FunctionDef):
        names.add(statement.name)
    if isinstance(statement, ast.Assign):
        for target in statement.targets:
            names.update(node.id for node in ast.walk(target) if isinstance(node, ast.Name))
        try:
            constants[statement.targets[0].id] = ast.literal_eval(statement.value)
        except (AttributeError, ValueError):
            pass  # computed

taken = set(numpy.__all__) | {name for name in dir(algorithms) if not name.startswith("_")}
assert not names & taken, "numpy has these names too: %s" % sorted(names & taken)

# The one line that keeps the builtins under other names may use them.
kept = {"max", "min", "sum"}
used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
lost = used & set(dir(builtins)) & taken
assert lost <= kept, "numpy replaces these builtins: %s" % sorted(lost - kept)
for name in kept:
    count = sum(isinstance(node, ast.Name) and node.id == name for node in ast.walk(tree))
    assert count <= 1, "%s is used %d times, and numpy replaces it" % (name, count)

strings = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
absolute = [s for s in strings if s.startswith(("/", "~")) or s[1:3] == ":\\"]
assert not absolute, "absolute paths: %s" % absolute
long = [line for line in text.splitlines() if len(line) > 120 and "'caption'" not in line and "'origin'" not in line]
assert not long, "long lines: %s" % long

print(json.dumps({k: v for k, v in constants.items() if not k.startswith(("VOXELS_", "BODIES_"))}))
