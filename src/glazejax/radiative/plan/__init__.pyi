from .plan import ALL as ALL
from .plan import Plan as Plan
from .plan import Report as Report
from .plan import Savings as Savings
from .plan import plan_stacks as plan_stacks
