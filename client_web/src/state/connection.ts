/** Status of the live session. */
import { signal } from "@preact/signals";
import type { Connection } from "../session/net/socket";

export const connection = signal<Connection>("connecting");
export const retryInMs = signal(0);
/** True if the browser reports no network. A server on the same machine may still respond. */
export const isOffline = signal(false);
/** The server's message if it is too full for this session; else null. */
export const rejectionMessage = signal<string | null>(null);
/** Current long computation of the server: precomputing a curve's operator, or shading a term for the first time. */
export const freezeStatus = signal<{
  state: "precomputing" | "shading";
  view: string;
  label: string;
  progress: number;
} | null>(null);
