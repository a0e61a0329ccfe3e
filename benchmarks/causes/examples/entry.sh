#!/bin/sh
# The smallest entry without Python: sh entry.sh CAMPAIGNS ANSWERS. It answers "unknown" to everything.
set -eu
mkdir -p "$2"
for folder in "$1"/*/; do
  name=$(basename "$folder")
  printf '{"schema_version": 1, "campaign": "%s", "causes": ["unknown"], "probability": {"unknown": 1.0}}\n' "$name" >"$2/$name.json"
done
