"""The parts of `diagnosis.localise`: excess by run, time, amplitude and frequency, backbones, phase plane, maps."""
