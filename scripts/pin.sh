#!/usr/bin/env bash
# Writes constraints.txt: every package of every extra but the trackers wandb and mlflow, transitive ones included, as installed in a fresh environment.
# No index address and no local version (`+cpu`), so that the pins hold for any index and any build of torch.
set -euo pipefail
cd "$(dirname "$0")/.."
venv=$(mktemp -d)
trap 'rm -rf "$venv"' EXIT
"${PYTHON:-python3}" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet '.[bench,dev,gpu,gym,local,ray,ui]' "torch==${TORCH:-2.13.0}"
{
    echo "# Exact versions for reproducible set-ups. Renew with: make pins"
    "$venv/bin/python" -m pip freeze --exclude openeureka | sed -E 's/\+[a-z0-9.]+$//; s/ @ .*//'
} > constraints.txt
