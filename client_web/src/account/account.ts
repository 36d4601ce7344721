/** Logging in and out. The token goes into a cookie that no script can read. */
import { effect } from "@preact/signals";
import { getJson, json, request, whenRefused } from "../net/api";
import type { MeBody } from "../protocol";
import { loginWords, me, readOnlyWords, refusals } from "../state/me";
import { note } from "../ui/toasts";

const ASKED = "This server asks who you are. Paste the token that you were given.";

/** Find out who is here; whether they may go on. */
export async function arrive(): Promise<boolean> {
  me.value = await getJson<MeBody>("/api/me");
  if (me.value.role === "anyone") loginWords.value = ASKED;
  return me.value.role !== "anyone";
}

export async function logIn(token: string): Promise<void> {
  await request("/api/login", json("POST", { token: token.trim() }));
  location.reload(); // what was edited is kept in the tab
}

export async function logOut(): Promise<void> {
  await request("/api/logout", { method: "POST" });
  location.reload();
}

effect(() => {
  if (refusals.value > 0 && readOnlyWords.peek() !== null) note(readOnlyWords.peek() as string);
});

whenRefused((words) => {
  if (me.peek().login) loginWords.value ??= words;
});
