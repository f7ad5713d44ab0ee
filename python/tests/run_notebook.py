"""Runs a notebook's code, cell after cell, without Jupyter: run_notebook.py FILE."""

import json
import sys

with open(sys.argv[1], encoding="utf-8") as file:
    cells = json.load(file)["cells"]
names = {"__name__": "__main__"}
code = [cell for cell in cells if cell["cell_type"] == "code"]
assert code, "no code"
for number, cell in enumerate(code, 1):
    exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
