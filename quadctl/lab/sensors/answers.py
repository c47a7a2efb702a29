"""Answers about all sensors of the height of some logs, as the command line and the page give them."""

from collections.abc import Sequence
from dataclasses import dataclass

from quadctl.errors import LogError
from quadctl.lab.sensors.diagnosis import NoAnswer, SensorDiagnosis, diagnose_sensor
from quadctl.lab.sensors.heights import READINGS, Heights, heights
from quadctl.logs.flight_log import FlightLog


@dataclass(frozen=True, eq=False)
class SensorAnswers:
    """One answer for each sensor that the logs hold."""

    answers: tuple[SensorDiagnosis | NoAnswer, ...]
    problems: tuple[str, ...] = ()
    """Sentences on readings that cannot be judged, such as those in another unit."""


def answers_on_sensors(logs: Sequence[FlightLog]) -> SensorAnswers | None:
    """Diagnose each sensor on the logs that have a reference for it; None where no log has a barometer.

    A range finder is judged only where something measures the height beside it: most logs have nothing.
    """
    if not any(log.has(READINGS["barometer"]) for log in logs):
        return None
    answers: list[SensorDiagnosis | NoAnswer] = []
    problems = []
    for sensor, column in READINGS.items():
        found = [(log.name, heights(log, sensor)) for log in logs if log.has(column)]
        known = [each for _, each in found if isinstance(each, Heights)]
        try:
            if known:
                answers.append(diagnose_sensor(known))
            elif sensor == "barometer":
                lacking = tuple((name, each) for name, each in found if not isinstance(each, Heights))
                answers.append(NoAnswer(sensor, lacking))
        except LogError as error:
            problems.append(str(error))
    return SensorAnswers(tuple(answers), tuple(problems))
