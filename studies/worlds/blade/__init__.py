"""World of flights by blade-element rotors: flights of drawn vehicles whose hidden effects only the truth beside them
names. Nothing in this package uses quadctl; its physics, estimators, controllers, missions and sensors are its own."""
