/** Asks for a token, over whatever was there: that goes on after it. */
import { useState } from "preact/hooks";
import { loginWords } from "../state/me";
import { logIn } from "./account";

export function Login() {
  const [token, setToken] = useState("");
  const [problem, setProblem] = useState<string | null>(null);
  const words = loginWords.value;
  if (words === null) return null;
  const send = async (event: Event) => {
    event.preventDefault();
    try {
      await logIn(token);
    } catch (error) {
      setProblem((error as Error).message);
    }
  };
  return (
    <div class="login-ground" role="dialog" aria-modal="true" aria-label="Log in">
      <form class="login" onSubmit={(event) => void send(event)}>
        <h1>relume</h1>
        <p>{words}</p>
        <label>
          Token
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
