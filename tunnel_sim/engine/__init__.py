"""The MuJoCo side: model, plugin, simulation, sensor and scenery."""
