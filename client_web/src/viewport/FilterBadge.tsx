/** Badges in the image's corner: active filters, which a click clears, and the image's fidelity. */
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
