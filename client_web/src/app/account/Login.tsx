/** Login dialog over the page, which continues after the login. */
import { useState } from "preact/hooks";
import { loginMessage } from "../../state/sessionUser";
import { logIn } from "./account";

export function Login() {
  const [token, setToken] = useState("");
  const [problem, setProblem] = useState<string | null>(null);
  const message = loginMessage.value;
  if (message === null) return null;
  const submit = async (event: Event) => {
    event.preventDefault();
    try {
      await logIn(token);
    } catch (error) {
      setProblem((error as Error).message);
    }
  };
  return (
    <div class="login-ground" role="dialog" aria-modal="true" aria-label="Log in">
      <form class="login" onSubmit={(event) => void submit(event)}>
        <h1>relume</h1>
        <p>{message}</p>
        <label>
          Access token
          <input
            type="password"
            autoComplete="current-password"
            autoFocus
            value={token}
            onInput={(event) => setToken(event.currentTarget.value)}
          />
        </label>
        {problem !== null && <p role="alert">{problem}</p>}
        <button class="primary" disabled={token.trim() === ""}>
          Log in
        </button>
      </form>
    </div>
  );
}
