"""Field world: batches of multirotor flights with own rotors, controllers, estimators and logs, as found outdoors and
in motion-capture halls, with none, one or two hidden effects per case."""
