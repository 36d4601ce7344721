/** How the editor stands with the server, in words. */
import { bake, coming } from "../state/bakes";
import { connection, refusedBecause, retryInMs } from "../state/connection";
import { formatSeconds } from "../ui/scale";

export function connectionWords(): string {
  switch (connection.value) {
    case "open":
      return "Connected";
    case "connecting":
      // where nothing was baked yet there is nothing to connect to
      return bake.value === null && coming.value !== null ? "Waiting for the bake" : "Connecting…";
    case "reconnecting":
      return retryInMs.value > 0
        ? `${refusedBecause.value === null ? "Connection lost. Edits are kept" : `Not let in: ${refusedBecause.value}`}; trying again in ${formatSeconds(retryInMs.value / 1000)}`
        : "Reconnecting…";
    case "closed":
      return "Not connected";
  }
}
