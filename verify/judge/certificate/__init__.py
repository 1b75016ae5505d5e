"""The checker of certificates: a function u that no motion outruns, read from a file and checked anew.

    file = read_certificate(folder)
    proof = check_certificate(file, question, exact=True)

It shares no code with what makes certificates: geometry comes from the scenario's raw numbers, and
everything else from certificate.npz. `tiling`, `sheets`, `continuity`, `blocked` and `bound` decide in
integers; the gradient inequality has two arithmetics, `floating` (with rounding bounds) and `rational`
(exact).
"""

from verify.judge.certificate.check import Proof, check_certificate
from verify.judge.certificate.file import CERTIFICATE, CertificateFile, read_certificate

__all__ = ["CERTIFICATE", "CertificateFile", "Proof", "check_certificate", "read_certificate"]
