#!/bin/sh
# learn.sh GAME MINUTES ?TRAIN? -- one round of learning: plays games with the present weights on all cores for that long, fits new
# weights to them, writes services/draughts/weights/GAME.inc. Build again (make draughts-train) and repeat: each round plays better
# games than the one before. Games and log stay in $TMPDIR/draughts-GAME.
set -eu
game=$1 minutes=$2 train=${3:-./draughts-train}
here=$(cd "$(dirname "$0")/.." && pwd)
folder=${TMPDIR:-/tmp}/draughts-$game
mkdir -p "$folder"
round=$(ls "$folder" | wc -l)
for core in $(seq "$(nproc)"); do
    nice -n 19 "$train" play "$game" $((minutes * 60)) $((round * 100 + core)) "${NODES:-700}" "$folder/$round.$core" &
done
wait
cat "$folder/$round".* >"$folder/games"
"$train" fit "$game" "$folder/games" "Round $round, $minutes minutes on $(nproc) cores." >"$folder/weights"
mv "$folder/weights" "$here/weights/$game.inc"
