/** Logging in and out. The token goes into a cookie that no script can read. */
import { effect } from "@preact/signals";
import { getJson, json, request, onUnauthorized } from "../../session/net/api";
import type { MeBody } from "../../protocol";
import { loginMessage, sessionUser, readOnlyMessage, numRejectedEdits } from "../../state/sessionUser";
import { showNote } from "../../ui/toasts";

const LOGIN_PROMPT = "Sign in: paste your access token.";

/** Load the current user; false if the server asks for a login. */
export async function initializeUser(): Promise<boolean> {
  sessionUser.value = await getJson<MeBody>("/api/me");
  if (sessionUser.value.role === "anyone") loginMessage.value = LOGIN_PROMPT;
  return sessionUser.value.role !== "anyone";
}

export async function logIn(token: string): Promise<void> {
  await request("/api/login", json("POST", { token: token.trim() }));
  location.reload(); // edits survive: they are stored in the tab
}

export async function logOut(): Promise<void> {
  await request("/api/logout", { method: "POST" });
  location.reload();
}

effect(() => {
  if (numRejectedEdits.value > 0 && readOnlyMessage.peek() !== null) showNote(readOnlyMessage.peek() as string);
});

onUnauthorized((message) => {
  if (sessionUser.peek().login) loginMessage.value ??= message;
});
