"""Section on flown step responses."""

from quadctl.lab import plots
from quadctl.lab.comparison.wording import plus, sentence
from quadctl.lab.report.parts import Cell, Section, Table, figure
from quadctl.lab.report.results import Results
from quadctl.lab.tracking.step_response import StepResponses, effect_of_the_ground


def step_section(r: Results) -> Section | None:
    steps = r.steps
    if steps is None:
        return None
    tracks = steps.on_one_reference
    figures = [
        figure(plots.step_heights(tracks), "steps", "Height over time; flights at other heights are shifted."),
        figure(
            plots.step_tail(tracks),
            "steps-tail",
            "Height above the setpoint after the step, which shows the effect of the ground.",
        ),
    ]
    note = "Flights out of ground effect are shifted to the same reference. " if len(tracks) > len(steps.flown) else ""
    explained = (
        f"{note}M_A is the integral of the tracking error, M_B that of the difference to the flight out of ground "
        "effect. In signed integrals positive and negative errors cancel (as in the published tables), in absolute "
        f"ones they do not. Measured over the {steps.table.window}."
    )
    return Section(
        "steps",
        r.titled_last("Step responses"),
        [*map(str, effect_of_the_ground(steps)), explained],
        figures,
        tables=[_metrics_table(steps)],
        after_text=[f"{sentence(str(note))}." for note in steps.table.notes],
    )


def _metrics_table(steps: StepResponses) -> Table:
    columns = {
        "M_A signed / m s": "m_a_signed",
        "M_A absolute / m s": "m_a_absolute",
        "M_B signed / m s": "m_b_signed",
        "M_B absolute / m s": "m_b_absolute",
        "MAE / m": "mae_m",
        "RMSE / m": "rmse_m",
        "largest error / m": "max_error_m",
    }
    signed = ("m_a_signed", "m_b_signed", "max_error_m")
    rows = []
    for name, flight in zip(steps.tracks, steps.table.flights, strict=True):
        cells = []
        for value in columns.values():
            v = getattr(flight, value)
            cells.append(Cell("none" if v is None else plus(v) if value in signed else f"{v:.3f}"))
        rows.append([Cell(name, f"{flight.flight}{' (reference flight)' if flight.is_reference else ''}"), *cells])
    unbroken = [name.replace("/ ", "/\u00a0").replace("m s", "m\u00a0s") for name in columns]
    return Table(["compensator", *unbroken], rows)
