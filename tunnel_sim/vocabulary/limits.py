"""Limits on reading, expansion and simulation, each with its reason; docs/reference/limits.md lists them.

Each limit is far above the records of rigs, and low enough that no input fills 2 GiB of memory or runs for
hours unexpectedly. The simulator and the readers use the same limits, so every written file can be read.
"""

from __future__ import annotations

DOCUMENT_BYTES = 2 * 2**20
"""Largest TOML file or spring table, bytes: ten thousand runs take 1.4 MB, and TOML is parsed at 1 MB/s."""
JSON_BYTES = 32 * 2**20
"""Largest JSON document, bytes: nested lists take thirty times as much memory as text."""
DATA_BYTES = 512 * 2**20
"""Largest Parquet file, bytes: twenty million samples of two columns take 320 MB."""
CSV_BYTES = 384 * 2**20
"""Largest run file as CSV, bytes: ten million samples take 300 MB, and five times as much memory."""
LINE_BYTES = 2**20
"""Longest line of a table of text, bytes: as many columns as are read, with a thousand characters each."""
CELLS = 64 * 2**20
"""Most cells of a table of text, lines times columns: ten million samples in six columns, 1 GB in memory."""
WEIGHTS_BYTES = 64 * 2**20
"""Largest file of network weights or training checkpoint, bytes: the paper's networks take 0.2 MB."""
MODEL_BYTES = 16 * 2**20
"""Most XML of a model of one's own, bytes: MJCF with its vertices in the text takes a few MB."""
ASSET_BYTES = 128 * 2**20
"""Most meshes, height fields and images of a model together, bytes: a whole robot takes 50 MB."""
UPLOAD_BYTES = 128 * 2**20
"""Most bytes dropped on the bench at once: they pass through memory; tunnel import reads larger files."""

READER_SECONDS = 20.0
"""Longest processor time of reading a file, s, with more for a large one by READER_PACE: most take 0.01 s."""
READER_PACE = 2.0**19
"""Slowest pace at which a library may read, bytes per s: workbooks, the slowest, are read at 2 MB/s."""
READER_MEMORY = 4 * 2**30
"""Maximum memory of the reading process, bytes, on Linux: enough for three times the largest file."""

NESTING = 32
"""Deepest nesting of tables and lists: the formats need six levels, and Python's recursion limit is a thousand."""
KEY_PARTS = 32
"""Most parts of a dotted TOML key: the parsing time grows with the square of their number."""
INTEGER_BITS = 128
"""Longest integer, bits: a NumPy seed has 128; a float cannot exceed 1024."""
NAME_CHARACTERS = 200
"""Longest name of a spring, or heading of a column, characters: two lines of a table."""
EXPRESSION_CHARACTERS = 500
"""Longest expression of an effect, characters: six lines of a page."""
OWN_EFFECTS = 64
"""Most effects of an effects file: more than twice the vocabulary."""
OWN_PARAMETERS = 8
"""Most parameters of an effect by expression: each is fitted."""
SMALLEST_NUMBER = 1e-100
"""Smallest magnitude above zero in a TOML file or table, SI: its square and cube do not underflow."""
LARGEST_NUMBER = 1e100
"""Largest magnitude in a TOML file, table or record, SI: its square and cube do not overflow."""
SLOWEST_RATE = 1e-6
"""Lowest sample rate, Hz: one sample in twelve days."""
FASTEST_RATE = 1e9
"""Highest sample rate, Hz: above it the sample times of a long record cannot be distinguished."""

RUN_SAMPLES = 20_000_000
"""Most samples of one run: five and a half hours at 1 kHz, 320 MB in memory."""
CAMPAIGN_SAMPLES = 40_000_000
"""Most samples of a campaign, and of the cases a sweep simulates together: 640 MB in memory."""
CAMPAIGN_RUNS = 10_000
"""Most runs of a campaign: a year's work on a rig."""
COLUMNS = 1_000
"""Most columns of a run file: a logger with many channels has a few hundred."""
CAMPAIGN_STEPS = 1_000_000_000
"""Most integration steps of a campaign: one and a half hours on one core."""
SPRINGS = 1_000
"""Most springs of a spring table: each is printed as one line."""
MODEL_FILES = 1_000
"""Most names of files in a model of one's own: a robot has a hundred meshes."""
MODEL_MEMORY = 2**30
"""Most memory that MuJoCo may take for a model, bytes: 8 times as much as all its meshes may have."""
MODEL_SECONDS = 30
"""Longest processor time for the law of a model's joint, s: a thousand bodies take 0.1 s."""

SWEEP_CASES = 100_000_000
"""Most cases of a sweep: years on one core."""
SWEEP_SHARDS = 1_000_000
"""Most shards of a sweep: each is three files in a folder, checked when the sweep continues."""
SWEEP_AXIS = 100_000
"""Most values of one axis of a sweep, with its lists expanded: the axes are held in memory, 1 kB per value."""
SWEEP_CHECKS = 10_000
"""Most combinations of rig and conditions with a sensor or an effect: all are checked first, 2000 per second."""
SCORE_CELLS = 10_000
"""Most cells of a score grid: each is one row of a table."""
SCORE_ROWS = 1_000_000
"""Most rows of a table of trials (trials × estimators × quantities): 1 GB in memory."""
