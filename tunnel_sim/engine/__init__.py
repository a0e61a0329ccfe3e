"""The simulation with MuJoCo: model, plugin, integration, sensor and scenery."""
