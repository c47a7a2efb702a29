"""Names and contents of the files for a paper."""

import json

from quadctl.lab.paper.latex import bibtex, document
from quadctl.lab.paper.statement import Statement

STEM = "model"


def paper_files(statement: Statement) -> dict[str, str]:
    """Contents by name of file: a LaTeX document that compiles alone, its BibTeX, and all numbers as JSON."""
    return {
        f"{STEM}.tex": document(statement, STEM),
        f"{STEM}.bib": bibtex(statement.model.effects),
        f"{STEM}.json": json.dumps(statement.to_dict(), indent=1, allow_nan=False) + "\n",
    }
