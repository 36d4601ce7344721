/** Messages about the connection to the server. */
import { bake, pendingBake } from "../state/bakes";
import { connection, isOffline, rejectionMessage, retryInMs } from "../state/connection";
import { formatSeconds } from "../ui/scale";

function lostConnectionMessage(): string {
  if (rejectionMessage.value !== null) return `Not let in: ${rejectionMessage.value}`;
  return `${isOffline.value ? "Offline" : "Connection lost"}. Edits are kept`;
}

export function connectionMessage(): string {
  switch (connection.value) {
    case "open":
      return "Connected";
    case "connecting":
      // where nothing was baked yet there is nothing to connect to
      return bake.value === null && pendingBake.value !== null ? "Waiting for the bake" : "Connecting…";
    case "silent":
      return `${isOffline.value ? "Offline" : "No answer from the server"}. Edits are kept`;
    case "reconnecting":
      return retryInMs.value > 0
        ? `${lostConnectionMessage()}; trying again in ${formatSeconds(retryInMs.value / 1000)}`
        : "Reconnecting…";
    case "closed":
      return "Not connected";
  }
}
