/** The logged-in user and logging out, if the server has logins. Tells a read-only user why editing is off. */
import { sessionUser, readOnlyMessage } from "../../state/sessionUser";
import { reportErrors } from "../../ui/toasts";
import { logOut } from "./account";

export function Account() {
  const { login, name, role, auth_method } = sessionUser.value;
  if (!login) return null;
  return (
    <div class="account" title={`Logged in as ${name}, role: ${role}`}>
      <span class="account-name">{name}</span>
      <small>{role}</small>
      {auth_method === "token" && <button onClick={() => void reportErrors(logOut)}>Log out</button>}
    </div>
  );
}

export function ReadOnly() {
  return readOnlyMessage.value === null ? null : (
    <p class="read-only" role="note">
      {readOnlyMessage.value}
    </p>
  );
}
