"""LaTeX and BibTeX of a statement. All text that comes from files or users is escaped."""

import hashlib
import json
import re
from collections.abc import Iterable, Sequence

from quadctl import __version__
from quadctl.effects import Effect
from quadctl.lab.fitting.fitter import BOOTSTRAP_SEED
from quadctl.lab.paper.statement import Statement

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "_": r"\_",
    "%": r"\%",
    "&": r"\&",
    "#": r"\#",
    "$": r"\$",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    '"': r"\textquotedbl{}",
    "\u2212": r"\ensuremath{-}",
}
_PREAMBLE = r"""\documentclass{article}
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\usepackage{amsmath}
\usepackage{booktabs}
\begin{document}
"""


def escape(text: str) -> str:
    """`text` as LaTeX prints it; characters beyond ASCII that are no Latin letters become `?`."""
    spaced = re.sub(r"\s+", " ", text)
    printed = (_SPECIAL.get(c, c if c.isprintable() and c <= "\u00ff" else "?") for c in spaced)
    return "".join(printed).replace("--", "-{}-")  # two hyphens would become a dash


def paper_files(statement: Statement) -> dict[str, str]:
    """Contents by name of file: a LaTeX document that compiles alone, its BibTeX, and all numbers as JSON."""
    return {
        "model.tex": document(statement, "model"),
        "model.bib": bibtex(statement.model.effects),
        "model.json": json.dumps(statement.to_dict(), indent=1, allow_nan=False) + "\n",
    }


def document(statement: Statement, bibliography: str) -> str:
    """A LaTeX document that compiles alone; `bibliography` is the name of the BibTeX file without its suffix."""
    parts = [
        rf"\section*{{Flight model {escape(statement.model.name)}}}",
        _equation(statement.model.effects),
        _parameter_table(statement),
        _correlation_table(statement),
        _error_table(statement),
        r"\section*{Methods}",
        escape(methods(statement)),
        _provenance(statement),
    ]
    if statement.model.effects:
        parts += [r"\bibliographystyle{plain}", rf"\bibliography{{{bibliography}}}"]
    return _PREAMBLE + "\n\n".join(part for part in parts if part) + "\n\n\\end{document}\n"


def bibtex(effects: Iterable[Effect]) -> str:
    """An entry for each source that the effects cite, as the effects word it."""
    sources = dict.fromkeys(effect.source for effect in effects)
    return "\n".join(f"@misc{{{citation_key(source)},\n  note = {{{escape(source)}}}\n}}\n" for source in sources)


def citation_key(source: str) -> str:
    """First word and year of a source, and a few digits that tell sources apart."""
    words = re.findall(r"[A-Za-z]+", source)
    year = re.search(r"\b(?:19|20)\d\d\b", source)
    digest = hashlib.sha256(source.encode()).hexdigest()[:4]
    return f"{words[0].lower() if words else 'source'}{year[0] if year else ''}-{digest}"


def methods(statement: Statement) -> str:
    """The methods paragraph, in plain English."""
    dataset = statement.dataset
    n, flights = len(dataset.targets), len(dataset.flights)
    bandwidths = [flight.bandwidth_hz for flight in dataset.flights]
    sources = " and ".join(sorted({flight.thrust_source for flight in dataset.flights}))
    low, high = min(bandwidths), max(bandwidths)
    width = f"{low:.1f}" if f"{low:.1f}" == f"{high:.1f}" else f"{low:.1f} to {high:.1f}"
    fitted = (
        "All parameters were fitted together to the acceleration of the vehicle by weighted least squares"
        if statement.parameters
        else "The model holds no parameter to fit"
    )
    return (
        f"The model was compared with {n} samples of {flights} flight{'s' if flights != 1 else ''}. "
        f"Thrust was computed from the {sources}. Measured and predicted acceleration went through the same "
        f"Gaussian low-pass filter with a bandwidth of {width} Hz. {fitted}; small per-flight biases "
        "of each flight were fitted beside them, with priors, and are part of the prediction. Errors and coefficients "
        f"of determination are those on {statement.hold_out}. Intervals are 95 % percentile intervals of a bootstrap "
        "over blocks of time, one-sided where a parameter is at a bound of what is physically possible, and the "
        "correlation of the parameters is that of its draws. The residual was tested for whiteness with the test of "
        "Ljung and Box per axis, the statistics of the flights added; samples of filtered signals are not independent, "
        "so that a small p is expected even of a complete model."
    )


# --- parts ------------------------------------------------------------------------------------------------------------


def _equation(effects: Sequence[Effect]) -> str:
    lines = [
        r"\begin{align*}",
        r"m \ddot{\mathbf{p}} &= m \mathbf{g} + \mathbf{R} \Bigl(-\mathbf{e}_z \sum_i T_i"
        + (r" + \mathbf{f}\Bigr)" if effects else r"\Bigr)")
        + (r", & T_i &= K\, T_i^0" if effects else r", & T_i &= T_i^0"),
        r"\end{align*}",
        r"Here $\mathbf{p}$ is the position (north, east, down), $\mathbf{R}$ the rotation from body to world axes and "
        r"$T_i^0$ the nominal thrust of rotor $i$"
        + (
            r"; $K$ is the product of the thrust ratios and $\mathbf{f}$ the sum of the forces below."
            if effects
            else "."
        ),
    ]
    if effects:
        lines.append(r"\begin{itemize}")
        lines += [
            rf"\item {escape(effect.name)} \cite{{{citation_key(effect.source)}}}: {_formula(effect)}"
            for effect in effects
        ]
        lines.append(r"\end{itemize}")
    else:
        lines.append("The model holds no effects: it is the rigid body.")
    return "\n".join(lines)


def _formula(effect: Effect) -> str:
    """Formula of the effect; its name with its parameters where it declares none."""
    if effect.formula:
        return f"${effect.formula}$"
    family, _, variant = effect.name.partition(".")
    names = ", ".join(symbol(p.name) for p in effect.parameters())
    return rf"$\mathrm{{{escape(variant or family)}}}({names})$"


def symbol(name: str) -> str:
    """Name of a parameter in mathematics: its first part with the rest as an index."""
    first, _, rest = name.partition("_")
    head = first if len(first) == 1 else rf"\mathrm{{{escape(first)}}}"
    return rf"{head}_{{\mathrm{{{escape(rest)}}}}}" if rest else head


def _number(value: float) -> str:
    """Four digits, in mathematics, so that the minus is one."""
    mantissa, _, exponent = f"{value:.4g}".partition("e")
    return f"${mantissa} \\times 10^{{{int(exponent)}}}$" if exponent else f"${mantissa}$"


def _table(columns: str, head: Sequence[str], rows: Iterable[Sequence[str]], caption: str) -> str:
    body = [" & ".join(row) + r" \\" for row in rows]
    return "\n".join(
        [
            r"\begin{table}[h]\centering",
            rf"\caption{{{caption}}}",
            rf"\begin{{tabular}}{{{columns}}}",
            r"\toprule",
            " & ".join(head) + r" \\",
            r"\midrule",
            *body,
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table}",
        ]
    )


def _parameter_table(statement: Statement) -> str:
    if not statement.parameters:
        return ""
    rows = [
        (
            escape(row.effect),
            f"${symbol(row.name)}$",
            _number(row.value),
            _interval(row.value, row.ci95),
            escape(row.unit) or "--",
        )
        for row in statement.parameters
    ]
    return _table("llrll", ("effect", "parameter", "value", r"95\,\% interval", "unit"), rows, "Fitted parameters.")


def _interval(value: float, ci95: tuple[float, float]) -> str:
    """Interval of a parameter; that of one at a bound has one end."""
    low, high = ci95
    if low < high and value in ci95:
        return rf"$\le$ {_number(high)}" if value == low else rf"$\ge$ {_number(low)}"
    return f"[{_number(low)}, {_number(high)}]"


def _correlation_table(statement: Statement) -> str:
    if len(statement.parameters) < 2:
        return ""
    names = [f"${symbol(row.name)}$" for row in statement.parameters]
    rows = [
        (name, *(f"${value:.2f}$" for value in row)) for name, row in zip(names, statement.correlation, strict=True)
    ]
    return _table("l" + "r" * len(names), ("", *names), rows, "Correlation of the parameters.")


def _error_table(statement: Statement) -> str:
    rows = []
    for axis, r_squared in statement.r_squared.items():
        w = statement.whiteness.get(axis)
        test = ("--", "--") if w is None else (f"{w.statistic:.1f} ({w.degrees})", _p_value(w.p_value))
        rows.append((axis, f"{statement.rmse[axis]:.4f}", f"${r_squared:.3f}$", *test))
    head = ("axis", r"RMSE, m/s$^2$", "$R^2$", "Ljung--Box $Q$ (d.o.f.)", "$p$")
    return _table("lrrrr", head, rows, f"Error and residual on {escape(statement.hold_out)}.")


def _p_value(p: float) -> str:
    return "$< 10^{-4}$" if p < 1e-4 else f"{p:.2g}"


def _provenance(statement: Statement) -> str:
    """Data, version, command, seed and thresholds."""
    data = [
        rf"\item {escape(flight.name)}: \texttt{{\small {flight.sha256 or 'no file'}}}"
        for flight in statement.dataset.flights
    ]
    rule = ", ".join(f"{name} = {value:g}" for name, value in statement.thresholds.items())
    return "\n".join(
        [
            r"\section*{Provenance}",
            rf"quadctl {escape(__version__)}, seed {BOOTSTRAP_SEED}. Command:",
            rf"\begin{{quote}}\raggedright\texttt{{{escape(statement.command)}}}\end{{quote}}",
            rf"Thresholds of the decision rule: {{\raggedright\small {escape(rule)}.\par}}",
            "SHA-256 of the data:",
            r"\begin{itemize}",
            *data,
            r"\end{itemize}",
        ]
    )
