"""CMA-ES line by line as in Hansen's tutorial (2016, arXiv:1604.00772), Table 1 and section A.

For one run, in 64 bits, in its own words; the root of C is the symmetric one.  Normal numbers are
given; `separable` keeps the diagonal only, with the rates of Ros and Hansen (2008).
"""

import math

import numpy as np


class CMAES:
    def __init__(self, mean, sigma, size, *, separable=False, active=True):
        n = len(mean)
        self.n, self.size, self.separable = n, size, separable
        self.mean, self.sigma = np.array(mean, float), float(sigma)
        self.p_sigma, self.p_c, self.C = np.zeros(n), np.zeros(n), np.eye(n)
        self.g = 0
        self.mu = mu = size // 2
        raw = np.array([math.log((size + 1) / 2) - math.log(i) for i in range(1, size + 1)])  # 49
        self.mu_eff = sum(raw[:mu]) ** 2 / sum(raw[:mu] ** 2)
        mu_eff_minus = sum(raw[mu:]) ** 2 / sum(raw[mu:] ** 2)
        self.c_c = (4 + self.mu_eff / n) / (n + 4 + 2 * self.mu_eff / n)  # 56
        self.c_1 = 2 / ((n + 1.3) ** 2 + self.mu_eff)  # 57
        self.c_mu = min(
            1 - self.c_1,
            2 * (self.mu_eff - 2 + 1 / self.mu_eff) / ((n + 2) ** 2 + 2 * self.mu_eff / 2),
        )  # 58
        if separable:
            self.c_1 *= (n + 2) / 3
            self.c_mu = min(1 - self.c_1, self.c_mu * (n + 2) / 3)
        self.c_sigma = (self.mu_eff + 2) / (n + self.mu_eff + 5)  # 55
        self.d_sigma = (
            1 + 2 * max(0, math.sqrt((self.mu_eff - 1) / (n + 1)) - 1) + self.c_sigma
        )  # 55
        alpha = min(
            1 + self.c_1 / self.c_mu,  # 50
            1 + 2 * mu_eff_minus / (self.mu_eff + 2),  # 51
            (1 - self.c_1 - self.c_mu) / (n * self.c_mu),  # 52
        )
        plus, minus = sum(raw[raw > 0]), -sum(raw[raw < 0])
        self.w = np.array([w / plus if w >= 0 else alpha * w / minus for w in raw])  # 53
        if not active:
            self.w = np.maximum(self.w, 0)
        self.chi = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))

    def generation(self, z, evaluate):
        """One generation by normal numbers [candidate, gene]; returns the candidates."""
        n, self.g = self.n, self.g + 1
        values, vectors = np.linalg.eigh(self.C)
        root = vectors @ np.diag(values**0.5) @ vectors.T
        inverse = vectors @ np.diag(values**-0.5) @ vectors.T
        x = np.array([self.mean + self.sigma * root @ each for each in z])  # 38 to 40
        order = sorted(range(self.size), key=lambda i: -evaluate(x[i]))
        y = [(x[i] - self.mean) / self.sigma for i in order]
        y_w = sum(self.w[i] * y[i] for i in range(self.mu))  # 41
        self.mean = self.mean + self.sigma * y_w  # 42, with c_m = 1
        self.p_sigma = (1 - self.c_sigma) * self.p_sigma + math.sqrt(
            self.c_sigma * (2 - self.c_sigma) * self.mu_eff
        ) * inverse @ y_w  # 43
        norm = np.linalg.norm(self.p_sigma)
        self.sigma *= math.exp(self.c_sigma / self.d_sigma * (norm / self.chi - 1))  # 44
        settled = math.sqrt(1 - (1 - self.c_sigma) ** (2 * (self.g + 1)))
        h_sigma = float(norm / settled < (1.4 + 2 / (n + 1)) * self.chi)
        self.p_c = (1 - self.c_c) * self.p_c + h_sigma * math.sqrt(
            self.c_c * (2 - self.c_c) * self.mu_eff
        ) * y_w  # 45
        balanced = [
            w if w >= 0 else w * n / np.linalg.norm(inverse @ each) ** 2
            for w, each in zip(self.w, y, strict=True)
        ]  # 46
        delta = (1 - h_sigma) * self.c_c * (2 - self.c_c)
        self.C = (
            (1 + self.c_1 * delta - self.c_1 - self.c_mu * sum(self.w)) * self.C
            + self.c_1 * np.outer(self.p_c, self.p_c)
            + self.c_mu * sum(w * np.outer(each, each) for w, each in zip(balanced, y, strict=True))
        )  # 47
        if self.separable:
            self.C = np.diag(np.diag(self.C))
        return x
