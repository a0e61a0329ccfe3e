"""Where the gap is: excess by run, time, amplitude and frequency; backbones, phase plane, maps."""
