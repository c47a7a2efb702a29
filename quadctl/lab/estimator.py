"""Flight model with the interface of scikit-learn: fit, predict, score."""

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

from quadctl.effects import Effect, catalog_with, find_effect
from quadctl.errors import SettingsError
from quadctl.lab.arrays import Floats
from quadctl.lab.comparison.comparison import explained
from quadctl.lab.flights.dataset import HoldOut
from quadctl.lab.selection.addition import add
from quadctl.lab.selection.refit import Refit, fit
from quadctl.lab.study import AnyModel, Flights, open_model, prepare_flights
from quadctl.model import Model, save_model


class FlightModel:
    """Vehicle and its effects, whose parameters are learned from flights.

    Parameters
    ----------
    model : Model, path or str
        A model, or the path of a model file or of a vehicle file (the rigid body).
    effects : sequence of str
        Names of effects to put on top of the model's own, such as "ground_effect.exponential".
    hold_out : "blocks" or "flights"
        Held-out data on which the error of a fit is judged: blocks of time of every flight, or whole flights.

    Attributes
    ----------
    model_ : Model
        Fitted model with provenance, usable by the compensator and the simulator.
    effects_ : tuple of Effect
        Its effects with their fitted parameters.
    ci95_ : dict
        95 % interval of each parameter, by name of effect and of parameter.
    rmse_ : dict
        Held-out acceleration error (RMSE): north, east, up and total, m/s^2.
    refit_ : Refit
        Result of the fit, which prints and plots itself.

    References
    ----------
    L. Buitinck et al., "API design for machine learning software: experiences from the scikit-learn project", 2013.

    Examples
    --------
    >>> from quadctl.lab import FlightModel
    >>> model = FlightModel("raptor.yaml", effects=["ground_effect.exponential"]).fit("flight.csv")
    >>> round(model.effects_[0].a, 1)
    0.3
    >>> low, high = model.ci95_["ground_effect.exponential"]["a"]
    >>> low < 0.3 < high
    True
    >>> model.score("other_flight.csv") > FlightModel("raptor.yaml").score("other_flight.csv")
    True
    """

    model_: Model
    effects_: tuple[Effect, ...]
    ci95_: dict[str, dict[str, tuple[float, float]]]
    rmse_: dict[str, float]
    refit_: Refit

    def __init__(self, model: AnyModel, effects: Sequence[str] = (), hold_out: HoldOut = "blocks") -> None:
        self.model = model
        self.effects = effects
        self.hold_out = hold_out

    def fit(self, flights: Flights) -> Self:
        """Fit all parameters together, as `fit` does; further effects are added one after the other, as `add` does.

        Raises
        ------
        SettingsError
            The model cannot be read, an effect is not known or twice there, or nothing can be fitted.
        LogError
            A log cannot be analysed.
        """
        model = open_model(self.model)
        kinds = self._kinds(model)
        dataset = prepare_flights(flights, model.vehicle, self.hold_out)
        result = fit(model, dataset) if not kinds else add(kinds[0], model, dataset)
        for kind in kinds[1:]:
            result = add(kind, result.model, dataset)
        self.refit_ = result
        self.model_ = result.model
        self.effects_ = result.model.effects
        self.ci95_ = {i.effect.name: dict(i.fitted.ci95) for i in result.model.stack if i.fitted is not None}
        self.rmse_ = result.after
        return self

    def predict(self, flights: Flights) -> Floats:
        """Predict the filtered acceleration, north, east, up, at the samples of the prepared flights, m/s^2, shape (n,
        3).

        Before `fit` the present parameters of the model are used. The times of the samples are those of
        `prepare_flights`.
        """
        model = self._current()
        return prepare_flights(flights, model.vehicle).aligned_for(model).predicted(model)

    def score(self, flights: Flights) -> float:
        """Share of the acceleration's variance that the model explains, R^2: 1 at best, negative at worst."""
        model = self._current()
        dataset = prepare_flights(flights, model.vehicle).aligned_for(model)
        return explained(dataset.residual(model), dataset.measured)

    def save(self, path: Path | str) -> None:
        """Write the model as a file that the commands and the compensator read."""
        save_model(self._current(), path)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Arguments of the constructor; `deep` is accepted for compatibility with scikit-learn."""
        return {name: getattr(self, name) for name in self._parameter_names()}

    def set_params(self, **params: Any) -> Self:
        """Change arguments of the constructor; fitted attributes stay as they are until the next `fit`.

        Raises
        ------
        SettingsError
            There is no such parameter.
        """
        names = self._parameter_names()
        for name, value in params.items():
            if name not in names:
                raise SettingsError(f"FlightModel has no parameter '{name}', expected one of: {', '.join(names)}")
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.get_params().items() if name != "model")
        name = self.model.name if isinstance(self.model, Model) else str(self.model)
        return f"FlightModel({name!r}, {given})"

    @classmethod
    def _parameter_names(cls) -> list[str]:
        return [name for name in inspect.signature(cls.__init__).parameters if name != "self"]

    def _current(self) -> Model:
        return self.model_ if hasattr(self, "model_") else self._start()

    def _start(self) -> Model:
        """Model with the further effects on top, with their default parameters."""
        model = open_model(self.model)
        for kind in self._kinds(model):
            model = model.plus(kind())
        return model

    def _kinds(self, model: Model) -> list[type[Effect]]:
        """Effect classes to put on top of `model`."""
        known = catalog_with(model.effect_files)
        kinds = [find_effect(name, "effects", known) for name in self.effects]
        families = {effect.family() for effect in model.effects}
        for kind in kinds:
            if kind.family() in families:
                raise SettingsError(f"{model.name}: holds a {kind.family()} already, so {kind.name} cannot be added")
            families.add(kind.family())
        return kinds
