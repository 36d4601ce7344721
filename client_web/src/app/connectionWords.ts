/** How the editor stands with the server, in words. */
import { bake, coming } from "../state/bakes";
import { connection, offline, refusedBecause, retryInMs } from "../state/connection";
import { formatSeconds } from "../ui/scale";

function lostWords(): string {
  if (refusedBecause.value !== null) return `Not let in: ${refusedBecause.value}`;
  return `${offline.value ? "Offline" : "Connection lost"}. Edits are kept`;
}

export function connectionWords(): string {
  switch (connection.value) {
    case "open":
      return "Connected";
    case "connecting":
      // where nothing was baked yet there is nothing to connect to
      return bake.value === null && coming.value !== null ? "Waiting for the bake" : "Connecting…";
    case "silent":
      return `${offline.value ? "Offline" : "No answer from the server"}. Edits are kept`;
    case "reconnecting":
      return retryInMs.value > 0
        ? `${lostWords()}; trying again in ${formatSeconds(retryInMs.value / 1000)}`
        : "Reconnecting…";
    case "closed":
      return "Not connected";
  }
}
