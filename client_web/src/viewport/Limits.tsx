/** In the picture's corner: what it leaves out, which a click brings back, and how near it is to its look. */
import { limits } from "../seen/limits";
import { marks } from "./fidelityMarks";

export function Limits() {
  return (
    <div class="limits">
      {limits.value.map(({ words, title, lift }) => (
        <button key={words} title={title} onClick={lift}>
          {words} <span aria-hidden="true">×</span>
        </button>
      ))}
      {marks().map(({ words, title }) => (
        <p key={words} title={title}>
          {words}
        </p>
      ))}
    </div>
  );
}
