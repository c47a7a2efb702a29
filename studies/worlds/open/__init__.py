"""World whose physics, sizes, controllers, estimators and sensors come from open publications on real multirotors."""
