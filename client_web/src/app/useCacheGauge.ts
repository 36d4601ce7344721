/** Bytes of precomputed transport in the server's cache, polled from its metrics. */
import { useEffect, useState } from "preact/hooks";
import { parseGauge } from "./parseMetrics";
import { serverUrl } from "../session/net/serverUrl";

const POLL_INTERVAL_MS = 10_000;

export function useCacheGauge(): number | null {
  const [bytes, setBytes] = useState<number | null>(null);
  useEffect(() => {
    const read = async () => {
      if (document.hidden) return;
      const response = await fetch(serverUrl("/metrics")).catch(() => null);
      if (response?.ok) setBytes(parseGauge(await response.text(), "relume_frozen_cache_bytes"));
    };
    void read();
    const timer = window.setInterval(() => void read(), POLL_INTERVAL_MS);
    return () => clearInterval(timer);
  }, []);
  return bytes;
}
