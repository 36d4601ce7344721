/** Who is logged in, and the way out; nothing where nobody logs in. Whoever may not edit is told why. */
import { me, readOnlyWords } from "../state/me";
import { attempt } from "../ui/toasts";
import { logOut } from "./account";

export function Account() {
  const { login, name, role, by } = me.value;
  if (!login) return null;
  return (
    <div class="account" title={`Logged in as ${name}, role: ${role}`}>
      <span class="account-name">{name}</span>
      <small>{role}</small>
      {by === "token" && <button onClick={() => void attempt(logOut)}>Log out</button>}
    </div>
  );
}

export function ReadOnly() {
  return readOnlyWords.value === null ? null : (
    <p class="read-only" role="note">
      {readOnlyWords.value}
    </p>
  );
}
