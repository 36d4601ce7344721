/** In the image's corner: what it leaves out, which a click brings back, and how near it is to its look. */
import { activeFilters } from "../state/visibility/activeFilters";
import { fidelityMarks } from "./fidelityLabels";

export function FilterBadge() {
  return (
    <div class="limits">
      {activeFilters.value.map(({ label, title, clear }) => (
        <button key={label} title={title} onClick={clear}>
          {label} <span aria-hidden="true">×</span>
        </button>
      ))}
      {fidelityMarks().map(({ label, title }) => (
        <p key={label} title={title}>
          {label}
        </p>
      ))}
    </div>
  );
}
