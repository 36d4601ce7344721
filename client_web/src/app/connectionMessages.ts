/** Messages about the connection to the server. */
import { bake, pendingBake } from "../state/bakes";
import { connection, isOffline, rejectionMessage, retryInMs } from "../state/connection";
import { formatSeconds } from "../ui/scale";

function lostConnectionMessage(): string {
  if (rejectionMessage.value !== null) return `Server busy: ${rejectionMessage.value}`;
  return `${isOffline.value ? "Offline" : "Connection lost"}. Your edits are safe`;
}

export function connectionMessage(): string {
  switch (connection.value) {
    case "open":
      return "Connected";
    case "connecting":
      // without a bake there is no session to connect to
      return bake.value === null && pendingBake.value !== null ? "Waiting for the bake" : "Connecting…";
    case "silent":
      return `${isOffline.value ? "Offline" : "The server does not respond"}. Your edits are safe`;
    case "reconnecting":
      return retryInMs.value > 0
        ? `${lostConnectionMessage()}; retrying in ${formatSeconds(retryInMs.value / 1000)}`
        : "Reconnecting…";
    case "closed":
      return "Not connected";
  }
}
