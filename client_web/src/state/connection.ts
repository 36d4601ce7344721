/** How the live session is doing. */
import { signal } from "@preact/signals";
import type { Connection } from "../session/net/socket";

export const connection = signal<Connection>("connecting");
export const retryInMs = signal(0);
/** The browser says that it has no network. A server on the same machine may still answer. */
export const isOffline = signal(false);
/** What the server said where it has no room for this session now; null where it said nothing. */
export const rejectionMessage = signal<string | null>(null);
/** What takes time on the server: a curve that is frozen, or a term that is shaded for the first time. */
export const freezeStatus = signal<{
  state: "precomputing" | "shading";
  view: string;
  label: string;
  progress: number;
} | null>(null);
